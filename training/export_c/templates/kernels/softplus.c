/* The logarithm of one plus the exponential. */
static inline REAL softplus_REAL(REAL x)
{
    return (REAL)(x > 0 ? (double)x + log1p(exp(-(double)x)) : log1p(exp((double)x)));
}
