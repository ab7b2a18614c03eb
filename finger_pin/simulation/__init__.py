"""One run: the loop, the `Simulator`, the Dataset with its energy account, the folder of results."""
