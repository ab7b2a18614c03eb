"""What a command line does: one file per command, joined by `application`."""
