"""Monte Carlo studies of placements and estimators, and the letter's figures."""
