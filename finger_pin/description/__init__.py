"""What a user writes: TOML files, read into frozen and checked data, and those that ship."""
