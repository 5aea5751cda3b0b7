#include "valves.h"

#include "board.h"
#include "protocol.h"

/* The eight pins as one byte, two bits a muscle like the codes: the lower is the inlet's, the upper the exhaust's. */
#define INLETS 0x55
#define EXHAUSTS 0xaa

static volatile uint8_t applied = ALL_OUT;

static uint8_t pins_of(uint8_t codes)
{
	/* An inlet's pin opens it; an exhaust's pin closes it. */
	return (codes & INLETS) | (~codes & EXHAUSTS);
}

void valves_start(void)
{
	board_start();
}

bool valves_known(uint8_t codes)
{
	return !(codes & codes >> 1 & INLETS);
}

void valves_set(uint8_t codes)
{
	uint8_t before = pins_of(applied), after = pins_of(codes);
	uint8_t staying = before & after & INLETS;
	board_write(staying | (before & EXHAUSTS)); /* inlets that close */
	board_write(staying | (after & EXHAUSTS));  /* exhausts */
	board_write(after);                         /* inlets that open */
	applied = codes;
}

uint8_t valves_applied(void)
{
	return applied;
}

void light_set(bool on)
{
	board_light(on);
}
