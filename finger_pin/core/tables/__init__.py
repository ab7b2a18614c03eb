"""The mechanism as plain arrays: structure, parameters, inputs and memory."""
