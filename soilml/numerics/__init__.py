"""Mathematics that knows no soil: roots, quadrature, sampling, fusion of estimates."""
