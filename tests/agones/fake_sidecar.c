/* The fake as a process: prints its port, then each request but those that ask for the GameServer.
 * usage: fake_sidecar [PORT] */
#include "tests/agones/fake_sidecar.h"

static void print(const char *request)
{
    if (strncmp(request, "GET ", 4) != 0) printf("%s\n", request), fflush(stdout);
}

int main(int argc, char **argv)
{
    static fake_sidecar fake;
    if (!fake_init(&fake, argc > 1 ? atoi(argv[1]) : 0)) return 1;
    fake.heard = print;
    printf("port %d\n", fake.port);
    fflush(stdout);
    if (!fake_listen(&fake)) return 1;
    pthread_join(fake.thread, NULL);
    return 0;
}
