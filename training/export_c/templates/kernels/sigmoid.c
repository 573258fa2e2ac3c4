/* The logistic function. */
static inline REAL sigmoid_REAL(REAL x)
{
    return (REAL)(1.0 / (1.0 + exp(-(double)x)));
}
