/*
 * The share of a weighted sample that lies below a place, with a step of width one for each of its n
 * points x: the sum of the weights times place - x, limited to 0 to 1. Sixteen points are taken side
 * by side, in loops that compilers turn into vector instructions.
 */
static REAL share_below_REAL(int n, REAL place, const REAL *x, const REAL *weight)
{
    REAL part[16] = {0}, step[16], total = 0;
    const int rest = n % 16;
    for (int i = 0; i < rest; ++i)
        total += weight[i] * at_most_REAL(at_least_REAL(place - x[i], 0), 1);
    for (int i = rest; i < n; i += 16) {
        for (int q = 0; q < 16; ++q)
            step[q] = place - x[i + q];
        for (int q = 0; q < 16; ++q)
            step[q] = at_least_REAL(step[q], 0);
        for (int q = 0; q < 16; ++q)
            step[q] = at_most_REAL(step[q], 1);
        for (int q = 0; q < 16; ++q)
            part[q] += weight[i + q] * step[q];
    }
    for (int q = 0; q < 16; ++q)
        total += part[q];
    return total;
}
