"""References, samples and recordings, and every figure of merit, defined once."""
