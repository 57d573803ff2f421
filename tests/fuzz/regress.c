/* Replays a fuzz corpus with an ordinary compiler: every file of the folder, each also cut at every power of two and
 * with one byte changed at 64 places (seeded), so that the decoders meet broken input in every CI run. */
#include "tests/fixtures/random.h"

#include <dirent.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

/* the decoder sees a heap copy of exactly the right size, so that a read past the end is an error under ASan */
static void try_bytes(const uint8_t *bytes, size_t n_byte)
{
    uint8_t *copy = malloc(n_byte ? n_byte : 1);
    if (!copy) return;
    memcpy(copy, bytes, n_byte);
    LLVMFuzzerTestOneInput(copy, n_byte);
    free(copy);
}

static size_t try_file(const char *path)
{
    FILE *file = fopen(path, "rb");
    if (!file) return 0;
    size_t cap = 1 << 20, n_try = 1;
    uint8_t *bytes = malloc(cap);
    size_t n = bytes ? fread(bytes, 1, cap, file) : 0;
    fclose(file);
    try_bytes(bytes, n);
    for (size_t cut = 1; cut < n; cut *= 2, n_try++) try_bytes(bytes, cut);
    uint64_t seed = 12345;
    for (int k = 0; k < 64 && n > 0; k++, n_try++) {
        size_t place = (size_t)random_below(&seed, n);
        uint8_t old = bytes[place];
        bytes[place] = (uint8_t)random_below(&seed, 256);
        try_bytes(bytes, n);
        bytes[place] = old;
    }
    free(bytes);
    return n_try;
}

int main(int argc, char **argv)
{
    size_t n_file = 0, n_try = 0;
    for (int i = 1; i < argc; i++) {
        DIR *folder = opendir(argv[i]);
        if (!folder) {
            fprintf(stderr, "%s: no such corpus\n", argv[i]);
            return 1;
        }
        for (struct dirent *entry; (entry = readdir(folder));) {
            char path[4096];
            if (entry->d_name[0] == '.') continue;
            snprintf(path, sizeof path, "%s/%s", argv[i], entry->d_name);
            size_t n = try_file(path);
            n_file += n > 0;
            n_try += n;
        }
        closedir(folder);
    }
    printf("%zu corpus files, %zu inputs\n", n_file, n_try);
    return n_file == 0;
}
