/* A board for tests: an ATmega328P in simavr, its line, its analog inputs and the levels of its pins.
 *
 * libsimavr is under the GPL, version 3; so is this file, which therefore stays among the tests.
 * SPDX-License-Identifier: GPL-3.0-or-later */
#include <simavr/avr_adc.h>
#include <simavr/avr_extint.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_hex.h>
#include <simavr/sim_io.h>
#include <stdlib.h>
#include <string.h>

#define FREQUENCY 16000000
#define BYTE_CYCLES 320 /* ten bits at 500,000 baud */
#define QUEUE (1 << 20)
#define CHANNELS 8
#define SUPPLY_MV 5000
enum { PINB = 0x23, DDRB, PORTB, PIND = 0x29, DDRD, PORTD, ADMUX = 0x7c };

enum { EVENT_PINS, EVENT_SENT, EVENT_SAMPLE, EVENT_RESET };
struct event {
	uint64_t cycle;
	uint32_t kind;  /* one of the above */
	uint32_t value; /* levels D4 to D13, bit 0 first; the byte; the channel; unused */
};

struct board {
	avr_t *avr;
	avr_uart_t *uart;
	avr_irq_t *input, *adc;
	void (*core_reset)(struct avr_t *);
	uint32_t millivolts[CHANNELS];
	uint32_t pins;
	int samples; /* whether conversions are events */
	int watched; /* whether the processor is looked at after each instruction */
	uint64_t masked_since, longest_masked;
	uint64_t in_next, out_free;
	uint32_t in_head, in_tail, event_head, event_tail;
	uint8_t in[QUEUE];
	struct event events[QUEUE];
};

static void log_event(struct board *b, uint64_t cycle, uint32_t kind, uint32_t value)
{
	b->events[b->event_head] = (struct event){cycle, kind, value};
	b->event_head = (b->event_head + 1) % QUEUE;
}

static void look_at_pins(struct board *b)
{
	const uint8_t *data = b->avr->data;
	/* An output has its level; on anything else the pull-downs at the gates win. */
	uint32_t pins = (data[PORTD] & data[DDRD]) >> 4 | (data[PORTB] & data[DDRB]) << 4;
	if (pins != b->pins)
		log_event(b, b->avr->cycle, EVENT_PINS, b->pins = pins);
}

static void on_port(struct avr_irq_t *irq, uint32_t value, void *board)
{
	look_at_pins(board);
}

static void on_sent(struct avr_irq_t *irq, uint32_t value, void *board)
{
	struct board *b = board;
	/* simavr tells when the byte is written; it is on the line for the time of a byte after the one before it. */
	uint64_t begin = b->avr->cycle > b->out_free ? b->avr->cycle : b->out_free;
	b->out_free = begin + BYTE_CYCLES;
	log_event(b, b->out_free, EVENT_SENT, value & 0xff);
}

static void on_conversion(struct avr_irq_t *irq, uint32_t value, void *board)
{
	struct board *b = board;
	uint32_t channel = b->avr->data[ADMUX] & 0x0f;
	/* Given anew for each conversion, so that a reset, which forgets the inputs, makes no difference. */
	if (channel < CHANNELS)
		avr_raise_irq(b->adc + ADC_IRQ_ADC0 + channel, b->millivolts[channel]);
	if (b->samples)
		log_event(b, b->avr->cycle, EVENT_SAMPLE, channel);
}

static void on_reset(struct avr_t *avr)
{
	struct board *b = avr->custom.data;
	b->core_reset(avr);
	look_at_pins(b);
	log_event(b, avr->cycle, EVENT_RESET, 0);
}

static void silent(avr_t *avr, const int level, const char *format, va_list arguments)
{
}

struct board *board_new(const char *hex)
{
	uint32_t size, start;
	uint8_t *code = read_ihex_file(hex, &size, &start);
	avr_t *avr = avr_make_mcu_by_name("atmega328p");
	if (!code || !avr)
		return NULL;
	struct board *b = calloc(1, sizeof *b);
	avr_global_logger_set(silent);
	avr_init(avr);
	avr->log = LOG_NONE;
	avr->frequency = FREQUENCY;
	avr->vcc = avr->avcc = avr->aref = SUPPLY_MV;
	avr_loadcode(avr, code, size, start);
	avr->codeend = start + size;
	free(code);
	b->avr = avr;
	avr->custom.data = b;
	b->core_reset = avr->reset;
	avr->reset = on_reset;
	for (avr_io_t *io = avr->io_port; io; io = io->next)
		if (!strcmp(io->kind, "uart"))
			b->uart = (avr_uart_t *)io;
	/* Else simavr looks at D2 and D3 in every cycle in which they are low: 45 times slower. */
	avr_extint_set_strict_lvl_trig(avr, 0, 0);
	avr_extint_set_strict_lvl_trig(avr, 1, 0);
	uint32_t flags = 0; /* no output to the console, no sleeping in polling loops */
	avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
	b->input = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
	b->adc = avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, 0);
	avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), on_sent, b);
	avr_irq_register_notify(b->adc + ADC_IRQ_OUT_TRIGGER, on_conversion, b);
	for (const char *port = "BD"; *port; port++) {
		avr_irq_t *irqs = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(*port), 0);
		avr_irq_register_notify(irqs + IOPORT_IRQ_REG_PORT, on_port, b);
		avr_irq_register_notify(irqs + IOPORT_IRQ_DIRECTION_ALL, on_port, b);
	}
	return b;
}

void board_free(struct board *b)
{
	avr_terminate(b->avr);
	free(b);
}

/* An interrupt of the run at a cycle that something outside waits for; simavr else runs on to its next timer. */
static avr_cycle_count_t stop(struct avr_t *avr, avr_cycle_count_t when, void *board)
{
	return 0;
}

/* Note for how long interrupts are off: after each instruction, of which simavr else makes several at once. */
static void look_at_interrupts(struct board *b)
{
	avr_t *avr = b->avr;
	avr->run_cycle_limit = avr->run_cycle_count = 1;
	if (avr->sreg[S_I])
		b->masked_since = avr->cycle;
	else if (avr->cycle - b->masked_since > b->longest_masked)
		b->longest_masked = avr->cycle - b->masked_since;
}

/* Run until `cycle`; return whether the processor still runs. */
int board_run(struct board *b, uint64_t cycle)
{
	avr_t *avr = b->avr;
	while (avr->cycle < cycle) {
		int waiting = b->in_head != b->in_tail;
		if (waiting && avr->cycle >= b->in_next) {
			b->uart->cycles_per_byte = BYTE_CYCLES; /* simavr counts a parity bit that is not there */
			avr_raise_irq(b->input, b->in[b->in_tail]);
			b->in_tail = (b->in_tail + 1) % QUEUE;
			b->in_next += BYTE_CYCLES;
			continue;
		}
		uint64_t next = waiting && b->in_next < cycle ? b->in_next : cycle;
		if (!avr_cycle_timer_status(avr, stop, b))
			avr_cycle_timer_register(avr, next - avr->cycle, stop, b);
		if (b->watched)
			look_at_interrupts(b);
		int state = avr_run(avr);
		if (state == cpu_Done || state == cpu_Crashed)
			return 0;
	}
	avr_cycle_timer_cancel(avr, stop, b);
	return 1;
}

uint64_t board_cycle(struct board *b)
{
	return b->avr->cycle;
}

/* Put bytes on the line to the board, one after the other; the first begins now or when the line is free. */
void board_write(struct board *b, const uint8_t *bytes, uint32_t length)
{
	if (b->in_head == b->in_tail && b->in_next < b->avr->cycle)
		b->in_next = b->avr->cycle;
	for (; length--; b->in_head = (b->in_head + 1) % QUEUE)
		b->in[b->in_head] = *bytes++;
}

/* Copy what happened since the last call, at most `most` events; return how many. */
uint32_t board_events(struct board *b, struct event *events, uint32_t most)
{
	uint32_t n = 0;
	for (; n < most && b->event_tail != b->event_head; b->event_tail = (b->event_tail + 1) % QUEUE)
		events[n++] = b->events[b->event_tail];
	return n;
}

void board_millivolts(struct board *b, uint32_t channel, uint32_t millivolts)
{
	b->millivolts[channel] = millivolts;
}

void board_log_samples(struct board *b, int on)
{
	b->samples = on;
}

/* Reset for the cause whose bit of MCUSR is set in `cause`, as by the reset pin or by a supply that breaks down. */
void board_reset(struct board *b, uint32_t cause)
{
	avr_reset(b->avr);
	avr_regbit_setto_raw(b->avr, b->avr->reset_flags.porf, cause & 1);
	avr_regbit_setto_raw(b->avr, b->avr->reset_flags.extrf, cause & 2);
	avr_regbit_setto_raw(b->avr, b->avr->reset_flags.borf, cause & 4);
}

/* Watch the interrupts from now on; it makes the simulation slower. */
void board_watch(struct board *b)
{
	b->watched = 1;
	b->masked_since = b->avr->cycle;
	b->longest_masked = 0;
}

/* Return the longest time that interrupts were off [cycles]. */
uint64_t board_longest_masked(struct board *b)
{
	return b->longest_masked;
}

uint8_t board_peek(struct board *b, uint16_t address)
{
	return b->avr->data[address];
}

void board_poke(struct board *b, uint16_t address, uint8_t value)
{
	b->avr->data[address] = value;
}

/* Go on at another place of the program, as after a disturbance; `address` in bytes. */
void board_jump(struct board *b, uint32_t address)
{
	b->avr->pc = address;
}

/* Return the 16-bit word of the program at `address`. */
uint16_t board_word(struct board *b, uint32_t address)
{
	return b->avr->flash[address] | b->avr->flash[address + 1] << 8;
}
