/* A client of the protocol (docs/reference/protocol.md) in C: plays action ACTION in all arenas for STEPS steps, and prints for each
 * step and arena the reward, the ends, the level and the observation.
 *
 *   client SOCKET LEVEL STEPS ACTION
 */
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

enum { HELLO = 1, RESET = 2, STEP = 3, CALL = 4, CLOSE = 5, STATE = 10, ANSWER = 11, ERROR = 255 };

static int server;
static char content[1 << 20];

static void fail(const char *why) {
    fprintf(stderr, "client: %s\n", why);
    exit(1);
}

static void exactly(void *to, size_t bytes) {
    for (size_t got = 0; got < bytes;) {
        ssize_t count = read(server, (char *)to + got, bytes - got);
        if (count <= 0) fail("the program has ended");
        got += (size_t)count;
    }
}

static void send_message(uint8_t kind, const char *text) {
    uint32_t length = (uint32_t)strlen(text) + 1;
    uint8_t head[5] = {length & 255, length >> 8 & 255, length >> 16 & 255, length >> 24, kind};
    if (write(server, head, 5) != 5 || write(server, text, length - 1) != (ssize_t)length - 1) fail("the program has ended");
}

/* Receives a message into `content`, and returns its kind. */
static uint8_t receive(void) {
    uint8_t head[5];
    exactly(head, 5);
    uint32_t length = head[0] | head[1] << 8 | head[2] << 16 | (uint32_t)head[3] << 24;
    if (length > sizeof content) fail("a message is too long");
    exactly(content, length - 1);
    content[length - 1] = 0;
    if (head[4] == ERROR) fail(content);
    return head[4];
}

/* Returns the number behind `"key":` in an array of the layout, or in the whole of it. */
static long number(const char *from, const char *key) {
    const char *at = strstr(from, key);
    if (!at) fail(key);
    return strtol(at + strlen(key), NULL, 10);
}

static const char *array(const char *layout, const char *name) {
    const char *at = strstr(layout, name);
    if (!at) fail(name);
    while (*at != '{') at--;
    return at;
}

int main(int count, char **words) {
    if (count != 5) fail("usage: client SOCKET LEVEL STEPS ACTION");
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    strncpy(address.sun_path, words[1], sizeof address.sun_path - 1);
    server = socket(AF_UNIX, SOCK_STREAM, 0);
    if (connect(server, (struct sockaddr *)&address, sizeof address)) fail("nobody serves there");
    send_message(HELLO, "{\"protocol\":1,\"client\":\"C\"}");
    if (receive() != HELLO) fail("no hello");

    long agents = number(content, "\"agents\":");
    const char *layout = strstr(content, "\"layout\":");
    const char *seen = array(layout, "\"name\":\"observations\"");
    long at_seen = number(seen, "\"offset\":"), numbers = strtol(strchr(strstr(seen, "\"shape\":["), ',') + 1, NULL, 10);
    long at_reward = number(array(layout, "\"name\":\"rewards\""), "\"offset\":");
    long at_terminated = number(array(layout, "\"name\":\"terminated\""), "\"offset\":");
    long at_truncated = number(array(layout, "\"name\":\"truncated\""), "\"offset\":");
    long at_level = number(array(layout, "\"name\":\"level\""), "\"offset\":");

    /* Shared memory: a head, the actions, and two results. */
    char path[256] = "";
    sscanf(strstr(content, "\"path\":\"") + 8, "%255[^\"]", path);
    int file = open(path, O_RDWR);
    size_t bytes = (size_t)number(strstr(content, "\"memory\":"), "\"bytes\":");
    uint32_t checksum = (uint32_t)strtoul(strstr(content, "\"checksum\":") + 11, NULL, 10);
    char *memory = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (file < 0 || memory == MAP_FAILED) fail("no shared memory");
    uint32_t head[6];
    memcpy(head, memory + 8, sizeof head);
    if (memcmp(memory, "PLAYBOT", 8) || head[0] != 1 || head[1] != checksum) fail("this is other memory");
    send_message(CALL, "{\"call\":\"mapped\"}");
    if (receive() != ANSWER) fail("no answer");

    char wish[1 << 16] = "{\"levels\":[";
    for (long agent = 0; agent < agents; agent++)
        sprintf(wish + strlen(wish), "%s%ld", agent ? "," : "", strtol(words[2], NULL, 10) + agent);
    send_message(RESET, strcat(wish, "]}"));
    for (long step = 0; step <= strtol(words[3], NULL, 10); step++) {
        if (receive() != STATE) fail("no state");
        const char *results = memory + head[3] + (size_t)content[0] * head[4];
        for (long agent = 0; agent < agents; agent++) {
            float reward;
            uint64_t level;
            memcpy(&reward, results + at_reward + 4 * agent, 4);
            memcpy(&level, results + at_level + 8 * agent, 8);
            printf("%ld %ld %g %d %d %" PRIu64, step, agent, reward, results[at_terminated + agent], results[at_truncated + agent], level);
            for (long i = 0; i < numbers; i++) {
                uint32_t bits;
                memcpy(&bits, results + at_seen + 4 * (agent * numbers + i), 4);
                printf(" %08" PRIx32, bits);
            }
            printf("\n");
        }
        for (long agent = 0; agent < agents; agent++) {
            int32_t action = (int32_t)strtol(words[4], NULL, 10);
            memcpy(memory + head[2] + 4 * agent, &action, 4);
        }
        send_message(STEP, "");
    }
    if (receive() != STATE) fail("no state");
    send_message(CLOSE, "");
    return 0;
}
