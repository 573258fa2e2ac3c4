/*
 * Replace a system a (m x n) by one of fewer rows with the same sums of squares |a x|^2, and return
 * their number: the upper factor of a QR decomposition by reflections, of the column with the
 * largest rest each time, until the rest changes no sum by more than about 1e-5 (its squares, times
 * those of the n monomials, which lie within -1 to 1). Golub and Van Loan, Matrix Computations,
 * section 5.4. A few rows, which the search would not pay for, stay as they are. `rest` and `change`
 * have room for n numbers.
 */
static int factor_rows_REAL(int m, int n, REAL *a, REAL *rest, REAL *change)
{
    const int most = m < n ? m : n;
    if (m <= FEW_ROWS)
        return m;
    REAL computed = 0; /* sum of all squares when these were last computed, not reduced */
    for (int k = 0; k < most; ++k) {
        int pivot = 0;
        REAL total = 0;
        for (int j = 0; j < n; ++j) {
            const REAL before = k > 0 ? a[(k - 1) * n + j] : 0;
            rest[j] = k > 0 ? rest[j] - before * before : 0;
            total += rest[j];
            pivot = rest[j] > rest[pivot] ? j : pivot;
        }
        if (!(total > REDUCED * computed)) { /* what is left of larger numbers is not exact */
            pivot = largest_column_REAL(m, n, n, k, a, rest);
            total = 0;
            for (int j = 0; j < n; ++j)
                total += rest[j];
            computed = total;
        }
        if (total < LEAST_REST)
            return k;
        reflect_REAL(m, n, n, k, pivot, a, change);
    }
    return most;
}
