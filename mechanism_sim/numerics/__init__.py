"""Mathematics without mechanics: small symbolic systems, piecewise polynomials."""
