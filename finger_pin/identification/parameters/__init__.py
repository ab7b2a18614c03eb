"""Parameters of an identification: numbers of scenarios within bounds."""
