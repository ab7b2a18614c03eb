"""One run: the loop, the stepper for loops of one's own, the Dataset with its energy account, the folder of results."""
