"""The laws of the model, compiled from their one source."""

from finger_pin import friction
from finger_pin.blocks import controller, joint_friction, reference, stroke_limiter, tendons
from finger_pin.core.compilation import compiled

friction_coefficient = compiled(friction.friction_coefficient)
friction_level = compiled(friction.friction_level)
stiction_rate = compiled(friction.stiction_rate)
friction_force = compiled(friction.friction_force)
capstan_coefficient = compiled(tendons.capstan_coefficient)
delivered_tension = compiled(tendons.delivered_tension)
half_tension = compiled(tendons.half_tension)
passive_acceleration = compiled(tendons.passive_acceleration)
joint_reaction = compiled(joint_friction.joint_reaction)
penetration = compiled(stroke_limiter.penetration)
limiter_torque = compiled(stroke_limiter.limiter_torque)
proportional_torque = compiled(controller.proportional_torque)
internal_level = compiled(controller.internal_level)
harmonic = compiled(reference.harmonic)
harmonic_rate = compiled(reference.harmonic_rate)
friction_coefficient_slope = compiled(friction.friction_coefficient_slope)
stiction_rate_slopes = compiled(friction.stiction_rate_slopes)
capstan_slope = compiled(tendons.capstan_slope)
joint_reaction_slopes = compiled(joint_friction.joint_reaction_slopes)
limiter_slopes = compiled(stroke_limiter.limiter_slopes)
