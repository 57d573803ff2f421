/* The journal of long computations: what is put in is found again, to the bit and by the next process; torn ends are
 * cut, damage is named. */
#include "server/calibrate/journal.h"

#include "server/base/hash.h"
#include "server/num/random.h"
#include "tests/check.h"

#include <float.h>

enum { N = 3, POINTS = 700 };
static pal_diagnostic diag;
static char path[] = "/tmp/palpate_journal_XXXXXX";

static void point(uint64_t key, double theta[N])
{
    for (int i = 0; i < N; i++) theta[i] = 60 * pal_random_unit(key, (uint64_t)i) - 30;
}

static double cost_of(int i)
{
    return i % 7 == 3 ? DBL_MAX : 100 * pal_random_unit(77, (uint64_t)i);
}

static pal_err put(pal_journal *j, const double theta[N], double cost)
{
    char *key = pal_journal_text(theta, N), *value = pal_journal_text(&cost, 1);
    pal_err err = key && value ? pal_journal_put(j, key, value, &diag) : PAL_ERR_MEMORY;
    free(key), free(value);
    return err;
}

static bool find(const pal_journal *j, const double theta[N], double *cost)
{
    char *key = pal_journal_text(theta, N);
    const char *value = key ? pal_journal_find(j, key) : NULL;
    free(key);
    return value && pal_journal_numbers(value, cost, 1);
}

static pal_journal *open_one(uint64_t problem)
{
    pal_journal *j = NULL;
    diag.text[0] = 0;
    if (pal_journal_open(path, &j, &diag)) return NULL;
    if (!pal_journal_begin(j, problem, &diag)) return j;
    pal_journal_close(j);
    return NULL;
}

static char *contents(size_t *n)
{
    FILE *file = fopen(path, "r");
    char *text = calloc(1, 1 << 20);
    *n = file && text ? fread(text, 1, (1 << 20) - 1, file) : 0;
    if (file) fclose(file);
    return text;
}

static void put_contents(const char *text, size_t n)
{
    FILE *file = fopen(path, "w");
    if (file && fwrite(text, 1, n, file) != n) CHECK_FAIL("cannot write");
    if (file) fclose(file);
}

static void what_was_put_is_found_again(void)
{
    double theta[N], cost;
    pal_journal *j = open_one(5);
    REQUIRE(j);
    point(0, theta);
    CHECK(!find(j, theta, &cost));
    for (int i = 0; i < POINTS; i++) {
        point((uint64_t)i, theta);
        CHECK_INT(put(j, theta, cost_of(i)), 0);
        CHECK_INT(put(j, theta, 1), 0); /* there already */
    }
    CHECK_INT(pal_journal_count(j), POINTS);
    /* another problem in the same file, of the same points */
    CHECK_INT(pal_journal_begin(j, 6, &diag), 0);
    CHECK_INT(pal_journal_count(j), 0);
    CHECK(!find(j, theta, &cost));
    CHECK_INT(put(j, theta, 4), 0);
    pal_journal_close(j);
    j = open_one(5);
    REQUIRE(j);
    CHECK_INT(pal_journal_count(j), POINTS);
    for (int i = 0; i < POINTS; i++) {
        point((uint64_t)i, theta);
        if (!find(j, theta, &cost)) CHECK_FAIL("point %d is lost", i);
        CHECK_NEAR(cost, cost_of(i), 0);
        theta[1] = nextafter(theta[1], 100);
        if (find(j, theta, &cost)) CHECK_FAIL("a neighbour of point %d is found", i);
    }
    pal_journal_close(j);
}

static void only_one_process_writes(void)
{
    pal_journal *j = open_one(5), *other = NULL;
    REQUIRE(j);
    CHECK_INT(pal_journal_open(path, &other, &diag), PAL_ERR_STATE);
    CHECK(strstr(diag.text, "another process is writing there"));
    CHECK(other == NULL);
    pal_journal_close(j);
    j = open_one(5);
    CHECK(j);
    pal_journal_close(j);
}

/* to the bit, also where they are no numbers */
static void numbers_come_back_with_their_bits(void)
{
    const double number[] = {1.0 / 3, -0.0, NAN, INFINITY, DBL_MAX, 5e-324};
    double back[6];
    char *text = pal_journal_text(number, 6);
    REQUIRE(text);
    CHECK(pal_journal_numbers(text, back, 6) && !memcmp(back, number, sizeof number));
    CHECK(!pal_journal_numbers("0x1p+0 0x1p+0", back, 3));
    free(text);
}

/* the file cut at any byte of its end: all whole lines are there, and it goes on from there */
static void a_torn_end_is_cut_off(void)
{
    size_t n, last = 0;
    char *text = contents(&n);
    double theta[N], cost;
    REQUIRE(text && n > 1000);
    /* the head and three lines */
    for (int line = 0; line < 4; line++) last = (size_t)(strchr(text + last, '\n') - text) + 1;
    for (size_t cut = 0; cut <= last; cut++) {
        int whole = 0;
        for (size_t i = 0; i < cut; i++) whole += text[i] == '\n';
        put_contents(text, cut);
        pal_journal *j = open_one(5);
        if (!j) CHECK_FAIL("cut at byte %zu: %s", cut, diag.text);
        REQUIRE(j);
        CHECK_INT(pal_journal_count(j), whole > 0 ? whole - 1 : 0);
        point(POINTS + 1, theta);
        CHECK_INT(put(j, theta, 0.25), 0);
        pal_journal_close(j);
        j = open_one(5);
        REQUIRE(j);
        CHECK(find(j, theta, &cost) && cost == 0.25);
        pal_journal_close(j);
    }
    put_contents(text, n);
    free(text);
}

/* a bit flipped in any byte of the first lines: said, with its line, and nothing of the file changed */
static void damage_is_named_with_its_line(void)
{
    size_t n, after;
    char *text = contents(&n), *still;
    REQUIRE(text && n > 1000);
    for (size_t at = 0; at < 300; at += at < 40 ? 1 : 3)
        for (int bit = 0; bit < 8; bit += 3) {
            int line = 1;
            char want[64];
            for (size_t i = 0; i < at; i++) line += text[i] == '\n';
            snprintf(want, sizeof want, line > 1 ? "line %d " : "is not a journal", line);
            text[at] ^= (char)(1 << bit);
            put_contents(text, n);
            pal_journal *j = open_one(5);
            CHECK(!j);
            if (!strstr(diag.text, want)) CHECK_FAIL("byte %zu: \"%s\" does not say \"%s\"", at, diag.text, want);
            still = contents(&after);
            CHECK(after == n && !memcmp(text, still, n));
            free(still);
            text[at] ^= (char)(1 << bit);
        }
    free(text);
}

static void lines_of_another_form_are_refused(void)
{
    static const char *const line[] = {"",
                                       "0000000000000005 0x1p+0 0x1p+0 ",
                                       "0000000000000005_0x1p+0 = 0x1p+0 ",
                                       "0000000000000005 0x1p+0 = 0x1p+0",
                                       " = ",
                                       "0000000000000005 = "};
    for (size_t k = 0; k < sizeof line / sizeof line[0]; k++) {
        char text[512];
        unsigned long long check = pal_hash_bytes(PAL_HASH_START, line[k], strlen(line[k]));
        snprintf(text, sizeof text, "palpate journal 1\n%s%016llx\n", line[k], check);
        put_contents(text, strlen(text));
        CHECK(!open_one(5));
        if (!strstr(diag.text, "line 2 is damaged")) CHECK_FAIL("\"%s\" for \"%s\"", diag.text, line[k]);
    }
    put_contents("palpate journal 1\n\n", 19);
    CHECK(!open_one(5));
    pal_journal *j = NULL;
    CHECK_INT(pal_journal_open("/nowhere/at/all.txt", &j, &diag), PAL_ERR_IO);
    CHECK(strstr(diag.text, "/nowhere/at/all.txt: cannot be opened"));
}

int main(void)
{
    int file = mkstemp(path);
    if (file >= 0) close(file);
    RUN(what_was_put_is_found_again);
    RUN(only_one_process_writes);
    RUN(numbers_come_back_with_their_bits);
    RUN(a_torn_end_is_cut_off);
    RUN(damage_is_named_with_its_line);
    RUN(lines_of_another_form_are_refused);
    unlink(path);
    return check_report();
}
