"""The compiled core: the laws of the model without Python inside."""
