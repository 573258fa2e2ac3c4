/* A value, or the upper bound where it is above; NaN stays NaN. */
static inline REAL at_most_REAL(REAL x, REAL high)
{
    return x > high ? high : x;
}
