"""The laws of the model, compiled from their one source."""

from finger_pin.core.compilation import compiled
from finger_pin.laws import bristle as friction
from finger_pin.laws import capstan, controller, harmonic, limiter, passive_tendon, reaction

friction_coefficient = compiled(friction.friction_coefficient)
friction_level = compiled(friction.friction_level)
stiction_rate = compiled(friction.stiction_rate)
friction_force = compiled(friction.friction_force)
capstan_coefficient = compiled(capstan.capstan_coefficient)
delivered_tension = compiled(capstan.delivered_tension)
half_tension = compiled(passive_tendon.half_tension)
passive_acceleration = compiled(passive_tendon.passive_acceleration)
joint_reaction = compiled(reaction.joint_reaction)
penetration = compiled(limiter.penetration)
limiter_torque = compiled(limiter.limiter_torque)
proportional_torque = compiled(controller.proportional_torque)
internal_level = compiled(controller.internal_level)
harmonic_position = compiled(harmonic.harmonic)
harmonic_rate = compiled(harmonic.harmonic_rate)
friction_coefficient_slope = compiled(friction.friction_coefficient_slope)
stiction_rate_slopes = compiled(friction.stiction_rate_slopes)
capstan_slope = compiled(capstan.capstan_slope)
joint_reaction_slopes = compiled(reaction.joint_reaction_slopes)
limiter_slopes = compiled(limiter.limiter_slopes)
