/* The largest elements, so many as asked for, in descending order, and their indices. */
static void largest_few_REAL(const REAL *x, int n, int few, REAL *values, int *indices)
{
    int found = 0;
    for (int i = 0; i < n; ++i) {
        if (found == few && !(x[i] > values[few - 1]))
            continue;
        int place = found < few ? found++ : few - 1;
        for (; place > 0 && values[place - 1] < x[i]; --place) {
            values[place] = values[place - 1];
            indices[place] = indices[place - 1];
        }
        values[place] = x[i];
        indices[place] = i;
    }
}
