/* Whether two values are equal; false where either is NaN. */
static inline bool equal_REAL(REAL a, REAL b)
{
    return a >= b && a <= b;
}
