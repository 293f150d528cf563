// SPDX-License-Identifier: MIT OR Apache-2.0
// The host's side of docs/protocol.md for a real-time thread: one request at a time, a stream beside it, no memory that is allocated.
// The reference implementation is rtl/board/src/host.rs; this one makes no request that is not needed to drive.

#ifndef TAKT_LINK_H
#define TAKT_LINK_H

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdint.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

enum {
    TAKT_WORDS = 16,       // of a request, at most
    TAKT_FRAME = 6 + 4 * TAKT_WORDS,
    TAKT_ATTEMPTS = 4,
    TAKT_MAGIC = 0x544b,
    TAKT_VERSION = 2,
};

// Addresses, in words.
enum {
    TAKT_ID = 0, TAKT_CONTROL = 1, TAKT_STATUS = 2, TAKT_MISSES = 7, TAKT_MOST_CYCLES = 11, TAKT_STREAM = 13,
    TAKT_DRIVEN = 0x3000, TAKT_SEEN = 0x3400, TAKT_FIFOS = 0x3800,
};

// Bits of `control` and `status`.
enum { TAKT_RUN = 1, TAKT_ENABLE = 4, TAKT_FAULT = 1 << 2, TAKT_DRIVE = 1 << 11, TAKT_CAUSES = 12 };

// Words of the last frame of the stream, the register `periods` first.
typedef struct {
    uint32_t words[TAKT_WORDS];
    int count;
} takt_frame;

typedef struct {
    int fd;
    uint8_t number;        // of the last request
    uint8_t in[512];
    int length;            // bytes in it
    takt_frame stream;
    int streamed;          // frames of the stream since this was last set to 0
    // The answer to the last request.
    int answered, status, count;
    uint32_t words[TAKT_WORDS];
    // The last request, to be made again.
    uint8_t out[TAKT_FRAME + 2];
    int out_length;
} takt_link;

static inline uint16_t takt_crc(const uint8_t *bytes, int length) {
    uint16_t sum = 0xffff;
    while (length--) {
        sum ^= (uint16_t)(*bytes++ << 8);
        for (int i = 0; i < 8; i++) sum = (uint16_t)(sum & 0x8000 ? sum << 1 ^ 0x1021 : sum << 1);
    }
    return sum;
}

static inline int64_t takt_now_ms(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * 1000LL + now.tv_nsec / 1000000;
}

static inline speed_t takt_speed(int baud) {
    switch (baud) {
        case 115200: return B115200;
        case 460800: return B460800;
        case 921600: return B921600;
        case 1000000: return B1000000;
        case 2000000: return B2000000;
        case 3000000: return B3000000;
        case 4000000: return B4000000;
        default: return B0;
    }
}

// Opens a serial port. 0, or an error of the system; EINVAL: this rate is not among those above.
static inline int takt_open(takt_link *link, const char *port, int baud) {
    struct termios settings;
    memset(link, 0, sizeof *link);
    link->fd = -1;
    if (takt_speed(baud) == B0) return EINVAL;
    link->fd = open(port, O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (link->fd < 0) return errno;
    if (tcgetattr(link->fd, &settings)) {
        int error = errno;
        close(link->fd);
        link->fd = -1;
        return error;
    }
    cfmakeraw(&settings);
    settings.c_cflag |= CLOCAL | CREAD;
    cfsetspeed(&settings, takt_speed(baud));
    tcsetattr(link->fd, TCSANOW, &settings);
    tcflush(link->fd, TCIOFLUSH);
    // Not the number of the last request of the program before, whose write this one's would be taken for.
    link->number = (uint8_t)takt_now_ms();
    return 0;
}

static inline uint32_t takt_word(const uint8_t *bytes) {
    return (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

// Takes what the line has brought, after waiting for it for at most so many ms. The number of bytes; -1 if the line is gone.
static inline int takt_hear(takt_link *link, int wait) {
    struct pollfd poller = {.fd = link->fd, .events = POLLIN};
    if (poll(&poller, 1, wait) <= 0) return 0;
    if (poller.revents & (POLLERR | POLLHUP | POLLNVAL) && !(poller.revents & POLLIN)) return -1;
    int got = (int)read(link->fd, link->in + link->length, sizeof link->in - (size_t)link->length);
    if (got < 0) return errno == EAGAIN || errno == EINTR ? 0 : -1;
    link->length += got;
    int from = 0;
    for (;;) {
        const uint8_t *frame = link->in + from;
        int left = link->length - from;
        if (left == 0) break;
        int is_stream = frame[0] == 0x3c;
        if (!is_stream && frame[0] != 0x5a) {
            from++;
            continue;
        }
        if (left < 4) break;
        int count = frame[3], end = 4 + 4 * count;
        if (count > TAKT_WORDS) {
            from++;
            continue;
        }
        if (left < end + 2) break;
        if (takt_crc(frame + 1, end - 1) != (frame[end] | frame[end + 1] << 8)) {
            from++;
            continue;
        }
        uint32_t *words = is_stream ? link->stream.words : link->words;
        if (is_stream) {
            link->stream.count = count;
            link->streamed++;
        } else if (frame[1] == link->number) {
            link->answered = 1;
            link->status = frame[2];
            link->count = count;
        }
        if (is_stream || frame[1] == link->number)
            for (int i = 0; i < count; i++) words[i] = takt_word(frame + 4 + 4 * i);
        from += end + 2;
    }
    link->length -= from;
    memmove(link->in, link->in + from, (size_t)link->length);
    if (link->length == (int)sizeof link->in) link->length = 0;
    return got;
}

static inline int takt_send(takt_link *link) {
    link->answered = 0;
    return write(link->fd, link->out, (size_t)link->out_length) == link->out_length ? 0 : -1;
}

// Makes a request without waiting for its answer: a read of `count` words, or a write of them if there are some. -1: the line is gone.
static inline int takt_request(takt_link *link, uint16_t address, int count, const uint32_t *words) {
    uint8_t *out = link->out;
    int end = 6;
    out[0] = 0xa5;
    out[1] = ++link->number;
    out[2] = words ? 2 : 1;
    out[3] = (uint8_t)count;
    out[4] = (uint8_t)address;
    out[5] = (uint8_t)(address >> 8);
    if (words)
        for (int i = 0; i < count; i++)
            for (int byte = 0; byte < 4; byte++) out[end++] = (uint8_t)(words[i] >> 8 * byte);
    uint16_t sum = takt_crc(out + 1, end - 1);
    out[end++] = (uint8_t)sum;
    out[end++] = (uint8_t)(sum >> 8);
    link->out_length = end;
    return takt_send(link);
}

// Waits for the answer to the last request, which is made again if it does not come; `wait`: ms in all. 0 if it is done, else the status;
// -1: no answer, or the line is gone.
static inline int takt_answer(takt_link *link, int wait) {
    int64_t until = takt_now_ms() + wait, again = takt_now_ms() + wait / TAKT_ATTEMPTS;
    while (!link->answered) {
        int64_t now = takt_now_ms();
        if (now >= until) return -1;
        if (now >= again) {
            // A frame that noise has begun would swallow what comes.
            link->length = 0;
            if (takt_send(link)) return -1;
            again = now + wait / TAKT_ATTEMPTS;
        }
        int64_t next = again < until ? again : until;
        if (takt_hear(link, (int)(next - now)) < 0) return -1;
    }
    return link->status;
}

static inline int takt_do(takt_link *link, uint16_t address, int count, const uint32_t *words, int wait) {
    if (takt_request(link, address, count, words)) return -1;
    return takt_answer(link, wait);
}

#endif
