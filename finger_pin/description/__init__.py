"""Descriptions: TOML files of a user's, read into frozen and checked data, and those that ship."""
