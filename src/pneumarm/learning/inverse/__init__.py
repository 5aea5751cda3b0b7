"""Moving by the inverse simulation alone (thesis section 4.4): back from the goals, then along the way found."""
