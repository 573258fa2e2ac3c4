/*
 * Rows from standard input, one a line: slip torque load sinkage drawbar_pull. Prints the codes of
 * the single estimate, the step and the answer, and the means. An empty line begins another set.
 */
#include <stdio.h>
#include <stdlib.h>

#include "wheel.h"

int main(void)
{
    wheel_work *work = malloc(sizeof *work); /* on the heap, where its ends are watched */
    wheel_memory *memory = malloc(sizeof *memory);
    wheel_estimate one;
    wheel_set_estimate set;
    char line[256];
    if (!work || !memory)
        return 1;
    wheel_set_start(memory, NULL);
    while (fgets(line, sizeof line, stdin)) {
        wheel_row row = wheel_empty_row();
        float *const into[] = {&row.slip, &row.torque, &row.load, &row.sinkage, &row.drawbar_pull};
        char *next = line;
        if (line[0] == '\n') {
            wheel_set_start(memory, NULL);
            continue;
        }
        for (int i = 0; i < 5; ++i)
            *into[i] = strtof(next, &next);
        bool inside[1] = {false};
        const int alone = wheel_single(&row, &one, work);
        const int step = wheel_set_step(memory, &row, 1, inside, NULL, work);
        const int answer = wheel_set_answer(memory, &set, work);
        printf("%d %d %d", alone, step, answer);
        for (int i = 0; i < 3; ++i)
            printf(" %.9g %.9g", alone < 0 ? 0.0 : (double)one.mean[i], answer < 0 ? 0.0 : (double)set.mean[i]);
        printf("\n");
    }
    free(work);
    free(memory);
    return 0;
}
