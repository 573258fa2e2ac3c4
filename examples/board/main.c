/*
 * Estimates of the soil under a wheel, on a board without Python:
 *
 *   soilml export c exported/wheel.onnx wheel.c
 *   gcc -std=c99 -O3 -I. examples/board/main.c wheel.c -lm -o board && ./board
 */
#include <math.h>
#include <stdio.h>

#include "wheel.h"

/* Readings of a drive over one soil: slip, torque (N m), load (N), drawbar pull (N). */
static const float drive[][4] = {
    {0.08f, 1.12f, 62.0f, -6.9f}, {0.15f, 1.41f, 58.0f, NAN}, {0.24f, 2.05f, 61.0f, -0.6f},
    {0.33f, 2.21f, 57.0f, NAN},   {0.41f, 2.74f, 60.0f, NAN}, {0.52f, 3.00f, 59.0f, 6.9f},
};

/* Large structs are static: they need not fit on the stack. */
static wheel_work work;
static wheel_memory memory;

static void print_estimate(const char *title, const float *mean, const float *std)
{
    static const char *const names[WHEEL_QUANTITIES] = {"cohesion", "friction angle", "shear modulus"};
    static const char *const units[WHEEL_QUANTITIES] = {"Pa", "rad", "m"};
    printf("%s\n", title);
    for (int i = 0; i < WHEEL_QUANTITIES; ++i)
        printf("  %-15s %8.4g +- %.2g %s\n", names[i], (double)mean[i], (double)std[i], units[i]);
}

int main(void)
{
    wheel_estimate one;
    wheel_set_estimate set;
    int code = wheel_set_start(&memory, NULL);
    for (size_t i = 0; i < sizeof drive / sizeof drive[0] && code >= 0; ++i) {
        wheel_row row = wheel_empty_row(); /* what is not measured stays NAN */
        row.slip = drive[i][0];
        row.torque = drive[i][1];
        row.load = drive[i][2];
        row.drawbar_pull = drive[i][3];
        if (i == 0 && (code = wheel_single(&row, &one, &work)) >= 0)
            print_estimate("one row", one.mean, one.std);
        code = wheel_set_step(&memory, &row, 1, NULL, NULL, &work);
    }
    if (code >= 0 && (code = wheel_set_answer(&memory, &set, &work)) >= 0)
        print_estimate("six rows of one soil", set.mean, set.std);
    printf("%s\n", wheel_message(code));
    return code < 0;
}
