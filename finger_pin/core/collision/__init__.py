"""Detection of contacts within a step: bounds of motion, culling of pairs, and continuous detection."""
