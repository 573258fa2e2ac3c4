/*
 * A set of readings on a Cortex-M4F: one row after another, with its answer, the instructions that
 * it took and the stack below this function. The file rows.h beside it has the rows, and the name of
 * the exported file:
 *
 *     #include "wheel_small.h"
 *     #define PREFIX(part) wheel_small_##part
 *     static const float ROWS[][5] = {{slip, torque, load, sinkage, drawbar_pull}, ...};
 *     #define START(memory) wheel_small_set_start(memory, NULL)
 *
 * Build, and run without a board (QEMU executes one instruction in each nanosecond of its clock,
 * of which the timer of this board counts every 40th):
 *
 *     arm-none-eabi-gcc -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 -O2 -std=gnu99 \
 *         --specs=rdimon.specs -nostartfiles -T mps2.ld -I. main.c startup.c wheel_small.c -lm \
 *         -o small.elf
 *     qemu-system-arm -M mps2-an386 -nographic -semihosting-config enable=on,target=native \
 *         -icount shift=0 -kernel small.elf
 */
#include "rows.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>

#define TIMER ((volatile uint32_t *)0xE000E010) /* SysTick: control, reload, value */
#define FULL 0xFFFFFFu
#define INSTRUCTIONS_PER_TICK 40u
#define WATCHED 4096 /* words of the stack that are filled before a call */
#define MARK 0xA5A5A5A5u

static PREFIX(work) work;
static PREFIX(memory) memory;

static uint32_t *stack_pointer(void)
{
    uint32_t *place;
    __asm volatile("mov %0, sp" : "=r"(place));
    return place;
}

int main(void)
{
    uint32_t *const stack = stack_pointer();
    if (START(&memory) < 0)
        return 1;
    for (unsigned int i = 0; i < sizeof ROWS / sizeof ROWS[0]; ++i) {
        PREFIX(row) row = PREFIX(empty_row)();
        row.slip = ROWS[i][0];
        row.torque = ROWS[i][1];
        row.load = ROWS[i][2];
        row.sinkage = ROWS[i][3];
        row.drawbar_pull = ROWS[i][4];
        for (uint32_t *word = stack - WATCHED; word < stack; ++word)
            *(volatile uint32_t *)word = MARK;
        TIMER[1] = FULL;
        TIMER[2] = 0;
        TIMER[0] = 5; /* on, by the processor's clock */
        while (TIMER[2] == 0) {
        }
        PREFIX(set_estimate) found;
        const uint32_t before = TIMER[2];
        const int code = PREFIX(set_step)(&memory, &row, 1, NULL, &found, &work);
        const uint32_t ticks = (before - TIMER[2]) & FULL;
        const uint32_t *deepest = stack - WATCHED;
        while (deepest < stack && *deepest == MARK)
            ++deepest;
        printf("%d %lu %ld", code, (unsigned long)(ticks * INSTRUCTIONS_PER_TICK),
               (long)((stack - deepest) * 4));
        for (int q = 0; q < 3; ++q)
            printf(" %.9g %.9g %.9g %.9g", found.mean[q], found.std[q], found.low[q], found.high[q]);
        printf(" %d\n", found.in_range);
    }
    return 0;
}
