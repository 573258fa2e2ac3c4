/*
 * Start of a program on a Cortex-M4F: vector table, floating-point unit, stack. Emulated board:
 * qemu-system-arm -M mps2-an386.
 */
#include <stdint.h>

extern uint32_t __stack_top;
int main(void);
void initialise_monitor_handles(void); /* printf through the emulator: newlib's librdimon */
void exit(int code);

/* Called by newlib's exit; nothing is registered. */
void _init(void);
void _fini(void);
void _init(void) {}
void _fini(void) {}

static void reset(void)
{
    volatile uint32_t *const coprocessors = (volatile uint32_t *)0xE000ED88;
    *coprocessors |= 0xFu << 20; /* full access to the floating-point unit */
    __asm volatile("dsb\n isb");
    initialise_monitor_handles();
    exit(main());
}

static void fault(void)
{
    for (;;)
        __asm volatile("bkpt 0");
}

__attribute__((section(".vectors"), used)) static const void *const vectors[16] = {
    &__stack_top,
    (const void *)reset,
    (const void *)fault,
    (const void *)fault,
    (const void *)fault,
    (const void *)fault,
    (const void *)fault,
};
