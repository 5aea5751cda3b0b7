"""Guarantees for agents that reach goals (thesis section 4.4): a filter in front of any of them."""
