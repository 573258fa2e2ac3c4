/*
 * What a Gauss-Newton step in one unknown needs of residuals r = a b and their derivatives
 * r' = c d, for each of n columns: sums of r' r' and of r r', which are added to those of other
 * rows. Matrices lie by rows: a (m x k), b (k x n), d (l x n); n is a multiple of sixteen. Columns
 * of c are those of `source` (m x width) that are `picked`, times factors; `slope` has room for two
 * rows of it.
 */
static void gauss_newton_sums_REAL(int m, int k, int l, int n, const REAL *a, const REAL *b,
                                   int width, const REAL *source, const int *picked,
                                   const REAL *factor, const REAL *d, REAL *slope, REAL *squares,
                                   REAL *products)
{
    four_REAL r[8], s[8];
    for (int i = 0; i < m; i += 2) {
        const int rows = i < m - 1 ? 2 : 1;
        for (int row = 0; row < rows; ++row)
            for (int p = 0; p < l; ++p)
                slope[row * l + p] = factor[p] * source[(i + row) * width + picked[p]];
        for (int j = 0; j < n; j += 16) {
            if (rows == 2) {
                rows_of_product_REAL(k, n, a + i * k, k, 1, b + j, r);
                rows_of_product_REAL(l, n, slope, l, 1, d + j, s);
            } else {
                row_of_product_REAL(k, n, a + i * k, 1, b + j, r);
                row_of_product_REAL(l, n, slope, 1, d + j, s);
            }
            for (int q = 0; q < 4; ++q) {
                four_REAL square = load_REAL(squares + j + 4 * q);
                four_REAL product = load_REAL(products + j + 4 * q);
                for (int row = 0; row < 4 * rows; row += 4) {
                    square = plus_product_REAL(square, s[q + row], s[q + row]);
                    product = plus_product_REAL(product, r[q + row], s[q + row]);
                }
                store_REAL(square, squares + j + 4 * q);
                store_REAL(product, products + j + 4 * q);
            }
        }
    }
}
