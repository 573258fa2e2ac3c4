/* Whether a value is another one than zero; true for NaN. */
static inline bool not_zero_REAL(REAL x)
{
    return !(x >= 0 && x <= 0);
}
