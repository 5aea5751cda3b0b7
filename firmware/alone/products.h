/* The two sums of products of a network in whole numbers, by hand: 22 and 12 cycles a product, where the compiler takes
 * over a hundred. The controller takes them in place of its own; a test compares what the board decides with these to
 * what C decides without. Rows are padded to four products. The carry after a multiplication is its result's sign. */
static int32_t sum_of_inputs(int place, int count)
{
	const int8_t *weights = network_weights + place;
	int16_t *units = units_inputs;
	int32_t total = 0;
	count >>= 2;
	__asm__ volatile(
		"clr r23\n"
		"1:\n\t"
		".rept 4\n\t"
		"lpm r20, Z+\n\t"
		"ld r21, X+\n\t"
		"ld r22, X+\n\t"
		"mulsu r20, r21\n\t" /* by the lower byte */
		"sbc %C0, r23\n\t"
		"sbc %D0, r23\n\t"
		"add %A0, r0\n\t"
		"adc %B0, r1\n\t"
		"adc %C0, r23\n\t"
		"adc %D0, r23\n\t"
		"muls r20, r22\n\t" /* by the upper one */
		"sbc %D0, r23\n\t"
		"add %B0, r0\n\t"
		"adc %C0, r1\n\t"
		"adc %D0, r23\n\t"
		".endr\n\t"
		"sbiw %1, 1\n\t"
		"brne 1b\n\t"
		"clr r1\n"
		: "+r"(total), "+w"(count), "+z"(weights), "+x"(units)
		:
		: "r20", "r21", "r22", "r23", "memory");
	return total;
}

static int32_t sum_of_hidden(int place, int8_t *units, int count)
{
	const int8_t *weights = network_weights + place;
	int32_t total = 0;
	count >>= 2;
	__asm__ volatile(
		"clr r23\n"
		"1:\n\t"
		".rept 4\n\t"
		"lpm r20, Z+\n\t"
		"ld r21, X+\n\t"
		"muls r20, r21\n\t"
		"sbc %C0, r23\n\t"
		"add %A0, r0\n\t"
		"adc %B0, r1\n\t"
		"adc %C0, r23\n\t"
		".endr\n\t"
		"sbiw %1, 1\n\t"
		"brne 1b\n\t"
		"clr r1\n\t"
		"sbrc %C0, 7\n\t" /* 24 bits are enough for 500 products; the fourth byte is the sign's */
		"com %D0\n"
		: "+r"(total), "+w"(count), "+z"(weights), "+x"(units)
		:
		: "r20", "r21", "r23", "memory");
	return total;
}
