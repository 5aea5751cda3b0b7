/* Frames: COBS( content | CRC-16/X-25 ) 0x00, where content is type u8, sequence u16, payload.
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

/* CRC-16/X-25 of `length` bytes. */
uint16_t crc16(const uint8_t *bytes, uint8_t length);

/* Take one byte off the line. After FRAME_TAKEN `bytes` holds the content until the next call. */
enum frame_event frame_receive(struct receiver *receiver, uint8_t byte);

/* Decode COBS in place; return the decoded length, or 0 where `bytes` are no COBS. */
uint8_t cobs_decode(uint8_t *bytes, uint8_t length);

/* Write the frame of `content` to `frame`; return the frame's length, its 0x00 included.
 * `content` has room for the CRC behind it, `frame` for two bytes more than content and CRC. */
uint8_t frame_encode(uint8_t *frame, uint8_t *content, uint8_t length);
