/* A value, or the lower bound where it is below; NaN stays NaN. */
static inline REAL at_least_REAL(REAL x, REAL low)
{
    return x < low ? low : x;
}
