/*
 * Shares of a weighted sample x (n) that lie below places, which are whole numbers apart, with a step
 * of width one for each point: sums of the weights times place - x, limited to 0 to 1. `after` is
 * each place's distance from the first. A point counts in part below the place next above it, and
 * wholly below those further on: so each is added twice. `part` and `whole` have room for three
 * numbers more than the last distance.
 */
static void shares_below_REAL(int n, REAL first, int few, const int *after, const REAL *x,
                              const REAL *weight, REAL *part, REAL *whole, REAL *share)
{
    const int last = after[few - 1];
    for (int j = 0; j < last + 3; ++j)
        part[j] = whole[j] = 0;
    for (int i = 0; i < n; ++i) {
        const REAL from = x[i] - first, most = (REAL)last;
        const REAL u = !(from > -1) ? -1 : from > most ? most : from;
        const int next = (int)(u + 1); /* the first place above the point */
        part[next] += weight[i] * ((REAL)next - u);
        whole[next + 1] += weight[i];
    }
    for (int j = 1; j <= last; ++j)
        whole[j] += whole[j - 1];
    for (int k = 0; k < few; ++k)
        share[k] = part[after[k]] + whole[after[k]];
}
