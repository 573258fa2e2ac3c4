/* -1, 0 or 1. */
static inline REAL sign_of_REAL(REAL x)
{
    return (REAL)((x > 0) - (x < 0));
}
