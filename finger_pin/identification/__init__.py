"""Identification: from recordings of a finger to the numbers of its scenario, with intervals."""
