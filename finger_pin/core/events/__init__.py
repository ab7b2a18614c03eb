"""Events within steps: kinks of laws, reversals of sliding, touches, and what is frozen until they occur."""
