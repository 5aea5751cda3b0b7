/* Frames: COBS( content | CRC-16/X-25 ) 0x00, where content is type u8, sequence u16, payload. That the two bytes of an
 * EXCHANGE are each other's complement, and that the sum of a PULSE is right, belongs to the frame too: a damaged one
 * is none.
 *
 * Nothing here knows the microcontroller, so that tests compile it for their own machine too. */
#pragma once
#include <stdint.h>

#include "protocol.h"

/* Bytes of a frame's content before its payload. */
#define HEADER_LENGTH 3
#define CRC_LENGTH 2

enum frame_event {
	FRAME_NONE,    /* in the middle of a frame, or between two */
	FRAME_TAKEN,   /* a request is complete: its content is in the receiver */
	FRAME_CORRUPT, /* something ended that is no request */
};

struct receiver {
	uint8_t bytes[LONGEST_FRAME]; /* as received, then the content of the frame taken */
	uint8_t length;               /* bytes received; more than LONGEST_FRAME are counted as one more */
};

/* Return two bytes of a frame as a number. */
static inline uint16_t u16(const uint8_t *bytes)
{
	return bytes[0] | (uint16_t)bytes[1] << 8;
}

/* CRC-16/X-25 of `length` bytes. */
uint16_t crc16(const uint8_t *bytes, uint8_t length);

/* Fletcher's sum of `length` bytes: their sum, and above it the sum of the sums of the first one, two, ... of them. */
uint16_t sum16(const uint8_t *bytes, uint8_t length);

/* Take one byte off the line. After FRAME_TAKEN `bytes` holds the content until the next call. */
enum frame_event frame_receive(struct receiver *receiver, uint8_t byte);

/* Decode COBS in place; return the decoded length, or 0 where `bytes` are no COBS. */
uint8_t cobs_decode(uint8_t *bytes, uint8_t length);

/* A frame being sent. It leaves in COBS blocks, each as soon as it is known: the line is busy with the first
 * one while the others are made. */
struct sender {
	uint8_t block[LONGEST_FRAME]; /* its code, then its bytes */
	uint8_t length;
	uint16_t crc;
	void (*out)(const uint8_t *bytes, uint8_t length);
};

/* Send a frame of at most LONGEST_FRAME bytes on the line to `out`: begin, its content byte by byte, end. */
void frame_begin(struct sender *sender, void (*out)(const uint8_t *bytes, uint8_t length));
void frame_put(struct sender *sender, uint8_t byte);
void frame_end(struct sender *sender);
