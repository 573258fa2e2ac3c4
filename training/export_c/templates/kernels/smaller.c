/* The smaller of two values; NaN where either is. */
static inline REAL smaller_REAL(REAL a, REAL b)
{
    return a < b || isnan(a) ? a : b;
}
