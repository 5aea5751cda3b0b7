#include "session.h"

#include <stdbool.h>
#include <util/atomic.h>

#include "clock.h"
#include "converter.h"
#include "frame.h"
#include "latches.h"
#include "protocol.h"
#include "reset.h"
#include "uart.h"
#include "valves.h"

#ifndef FIRMWARE
#error "FIRMWARE, the hash of the sources, is given by the Makefile"
#endif

/* What decide() says of a request that is not refused. */
#define ACCEPTED 0

static struct receiver receiver;
static bool connected, configured;
static uint32_t session;
/* The last accepted request: a retry of it is answered alike. */
static uint16_t last_sequence;
static uint8_t last_type, last_reason;
static uint16_t seen; /* flags to be told with the next reply */
/* The number of the last PULSE, for as long as nothing else has set the valves: none goes on twice. */
static bool numbered;
static uint8_t last_number;

static uint32_t u32(const uint8_t *bytes)
{
	return u16(bytes) | (uint32_t)u16(bytes + 2) << 16;
}

static struct sender sender;

static void put8(uint8_t value)
{
	frame_put(&sender, value);
}

static void put16(uint16_t value)
{
	put8(value);
	put8(value >> 8);
}

static void put32(uint32_t value)
{
	put16(value);
	put16(value >> 16);
}

static void begin(uint8_t type, uint16_t sequence)
{
	frame_begin(&sender, uart_send);
	put8(type);
	put16(sequence);
}

static void put_state(uint16_t more)
{
	uint16_t flags;
	uint8_t valves;
	/* Of one moment: a latch that came in between would vent valves that no flag explains. */
	ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
	{
		flags = latches_flags();
		valves = valves_applied();
	}
	if (uart_overrun())
		more |= OVERRUN_SEEN;
	put16(flags | (configured ? CONFIGURED : 0) | seen | more);
	put8(valves);
	seen = 0;
}

static void hello(uint16_t sequence, uint8_t version)
{
	begin(HELLO, sequence);
	put8(version);
	put32(FIRMWARE);
	put32(session);
	put8(reset_cause());
	put16(reset_boots());
	frame_end(&sender);
}

static void refused(uint16_t sequence, uint8_t reason, uint16_t more)
{
	begin(REFUSED, sequence);
	put8(reason);
	put_state(more);
	frame_end(&sender);
}

static void status(uint16_t sequence, uint16_t more)
{
	begin(STATUS, sequence);
	put32(clock_microseconds());
	put_state(more);
	frame_end(&sender);
}

static void reading(uint16_t sequence, uint16_t more)
{
	struct sample sample;
	converter_read(&sample);
	begin(READING, sequence);
	put32(sample.time);
	put_state(more);
	for (uint8_t i = 0; i < JOINTS; i++)
		put16(sample.angle[i]);
	for (uint8_t i = 0; i < MUSCLES; i++)
		put16(sample.pressure[i]);
	for (uint8_t i = 0; i < JOINTS; i++)
		put16(sample.velocity[i]);
	for (uint8_t i = 0; i < EXTRAS; i++)
		put16(sample.extra[i]);
	frame_end(&sender);
}

static void connect(uint16_t sequence, const uint8_t *payload)
{
	uint8_t version = payload[0];
	if (version < OLDEST_VERSION || version > VERSION) {
		refused(sequence, WRONG_VERSION, 0);
		return;
	}
	latches_disarm();
	connected = true;
	configured = false; /* whoever connects says what the limits are */
	numbered = false;
	session = u32(payload + 1);
	last_sequence = sequence;
	last_type = CONNECT;
	hello(sequence, version);
}

static uint8_t configure(const uint8_t *payload)
{
	uint8_t conversions = payload[0], velocity_ms = payload[1];
	uint16_t limits[MUSCLES];
	if (latches_armed())
		return STILL_ARMED;
	if (conversions != 5 && conversions != 7 && conversions != 9)
		return BAD_VALUE;
	if (velocity_ms < 1 || velocity_ms > MOST_VELOCITY_MS)
		return BAD_VALUE;
	for (uint8_t i = 0; i < MUSCLES; i++) {
		limits[i] = u16(payload + 2 + 2 * i);
		if (limits[i] < 1 || limits[i] > 0x3ff)
			return BAD_VALUE;
	}
	converter_configure(conversions, velocity_ms, limits);
	configured = true;
	return ACCEPTED;
}

static uint8_t arm(const uint8_t *payload)
{
	if (u32(payload) != session)
		return WRONG_SESSION;
	if (!configured)
		return NOT_CONFIGURED;
	if (!latches_arm())
		return CAUSE_REMAINS;
	numbered = false;
	return ACCEPTED;
}

static uint8_t exchange(uint8_t codes)
{
	if (!latches_armed())
		return NOT_ARMED;
	if (!valves_known(codes))
		return BAD_VALUE;
	numbered = false;
	return latches_valves(codes, 0, 0) ? ACCEPTED : NOT_ARMED;
}

static uint8_t pulse(const uint8_t *payload)
{
	uint8_t number = payload[0], codes = payload[1], pulses = 0;
	uint16_t open[MUSCLES];
	if (!latches_armed())
		return NOT_ARMED;
	if (numbered && number == last_number)
		return latches_feed() ? ACCEPTED : NOT_ARMED;
	if (!valves_known(codes))
		return BAD_VALUE;
	for (uint8_t i = 0; i < MUSCLES; i++) {
		open[i] = u16(payload + 2 + 2 * i);
		if ((codes >> 2 * i & 3) == CLOSED || open[i] == HOLD)
			continue;
		if (open[i] < 1 || open[i] > LONGEST_PULSE)
			return BAD_VALUE;
		pulses |= 1 << i;
	}
	numbered = true;
	last_number = number;
	return latches_valves(codes, pulses, open) ? ACCEPTED : NOT_ARMED;
}

/* Do what a fresh request asks; return why not, or ACCEPTED. */
static uint8_t act(uint8_t type, const uint8_t *payload)
{
	switch (type) {
	case CONFIGURE: return configure(payload);
	case ARM: return arm(payload);
	case DISARM: latches_disarm(); return ACCEPTED;
	case EXCHANGE: return exchange(payload[0]);
	case PULSE: return pulse(payload);
	default: return ACCEPTED; /* READ does nothing but read */
	}
}

static void take(const uint8_t *request)
{
	uint8_t type = request[0];
	uint16_t sequence = u16(request + 1);
	const uint8_t *payload = request + HEADER_LENGTH;
	uint16_t repeated = 0;

	if (type == CONNECT) {
		connect(sequence, payload);
		return;
	}
	if (!connected) {
		refused(sequence, NOT_CONNECTED, 0);
		return;
	}
	uint16_t ahead = sequence - last_sequence;
	if (ahead == 0 && type == last_type) {
		repeated = REPEATED;
	} else if (ahead == 0 || ahead > 0x7fff) {
		seen |= STALE_SEEN;
		return;
	} else {
		last_sequence = sequence;
		last_type = type;
		last_reason = act(type, payload);
	}
	if (last_reason)
		refused(sequence, last_reason, repeated);
	else if (type == EXCHANGE || type == PULSE || type == READ)
		reading(sequence, repeated);
	else
		status(sequence, repeated);
}

void session_start(void)
{
	static const uint8_t END = 0;
	uart_send(&END, sizeof END);
}

void session_byte(uint8_t byte)
{
	switch (frame_receive(&receiver, byte)) {
	case FRAME_TAKEN: take(receiver.bytes); break;
	case FRAME_CORRUPT: seen |= CORRUPT_SEEN; break;
	case FRAME_NONE: break;
	}
}
