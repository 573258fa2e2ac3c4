/* The larger of two values; NaN where either is. */
static inline REAL larger_REAL(REAL a, REAL b)
{
    return a > b || isnan(a) ? a : b;
}
