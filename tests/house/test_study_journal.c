/* The journal of a study's reference: what was kept comes back with its bits, a file that ends anywhere or was touched
 * anywhere gives what stands whole before that place and goes on there, one of something else is begun anew. */
#include "server/study/study_journal.h"
#include "tests/check.h"

#include <unistd.h>

enum { RECORDS = 5 };
static char folder[] = "/tmp/palpate_journal_XXXXXX";
static char path[64];

static int length(int k)
{
    return 3 * (k * k + 1);
}

static double number(int k, int i)
{
    return k == 2 && i == 1 ? NAN : ldexp(1.0 + i / 3.0, k - i) * (i % 2 ? -1 : 1);
}

static pal_err add(pal_study_journal *j, int k)
{
    double value[100];
    pal_study_answer answer = {.err = k == 3 ? PAL_ERR_NUMERIC : PAL_ERR_OK, .n_node = 100 * k};
    if (k == 3) snprintf(answer.reason, sizeof answer.reason, "no rest after 120 Newton iterations");
    for (int i = 0; i < length(k); i++) value[i] = number(k, i);
    return pal_study_journal_add(j, 1000 + (uint64_t)k, &answer, value, length(k));
}

static void check_record(const pal_study_journal *j, int k)
{
    double value[100], should[100];
    pal_study_answer answer;
    REQUIRE(pal_study_journal_find(j, 1000 + (uint64_t)k, &answer, value, length(k)));
    for (int i = 0; i < length(k); i++) should[i] = number(k, i);
    CHECK(!memcmp(value, should, sizeof *value * (size_t)length(k)));
    CHECK_INT(answer.n_node, 100 * k);
    CHECK(answer.err == (k == 3 ? PAL_ERR_NUMERIC : PAL_ERR_OK));
    CHECK((strstr(answer.reason, "Newton") != NULL) == (k == 3));
    CHECK(!pal_study_journal_find(j, 1000 + (uint64_t)k, &answer, value, length(k) + 3));
}

static pal_study_journal *open_it(uint64_t of, bool again)
{
    pal_study_journal *j = NULL;
    pal_diagnostic diag = {""};
    if (pal_study_journal_open(path, of, again, &j, &diag)) CHECK_FAIL("%s", diag.text);
    return j;
}

static size_t slurp(unsigned char *bytes)
{
    FILE *in = fopen(path, "rb");
    size_t n = in ? fread(bytes, 1, 1 << 16, in) : 0;
    if (in) fclose(in);
    return n;
}

static void spill(const unsigned char *bytes, size_t n)
{
    FILE *out = fopen(path, "wb");
    if (!out || fwrite(bytes, 1, n, out) != n) CHECK_FAIL("%s: not written", path);
    if (out) fclose(out);
}

static size_t fill(unsigned char *bytes)
{
    pal_study_journal *j = open_it(7, true);
    for (int k = 0; k < RECORDS; k++) CHECK_INT(j ? add(j, k) : 1, 0);
    pal_study_journal_close(j);
    return slurp(bytes);
}

static void what_is_kept_comes_back_with_its_bits(void)
{
    static unsigned char bytes[1 << 16];
    int n_before;
    CHECK(fill(bytes) > 1000);
    pal_study_journal *j = open_it(7, false);
    REQUIRE(j);
    CHECK_INT(pal_study_journal_count(j, &n_before), RECORDS);
    CHECK_INT(n_before, RECORDS);
    for (int k = 0; k < RECORDS; k++) check_record(j, k);
    pal_study_journal_close(j);
    /* of another body, or asked to begin anew: nothing, and nothing left of it */
    for (int k = 0; k < 2; k++) {
        fill(bytes);
        j = open_it(k ? 7 : 8, k);
        REQUIRE(j);
        CHECK_INT(pal_study_journal_count(j, NULL), 0);
        pal_study_journal_close(j);
        CHECK_INT((int)slurp(bytes), 28);
    }
}

/* a kill may end the file at any byte */
static void a_file_that_ends_anywhere_goes_on_behind_its_last_whole_record(void)
{
    static unsigned char bytes[1 << 16], other[1 << 16];
    size_t n = fill(bytes);
    for (size_t end = 0; end <= n; end += end < 60 || end + 300 > n ? 1 : 37) {
        spill(bytes, end);
        pal_study_journal *j = open_it(7, false);
        REQUIRE(j);
        int have = pal_study_journal_count(j, NULL);
        CHECK(have <= RECORDS && (end < n || have == RECORDS) && (end == n || have < RECORDS));
        for (int k = 0; k < have; k++) check_record(j, k);
        for (int k = have; k < RECORDS; k++) CHECK_INT(add(j, k), 0);
        pal_study_journal_close(j);
        CHECK(slurp(other) == n && !memcmp(other, bytes, n));
    }
}

static void a_byte_that_was_changed_ends_it_there(void)
{
    static unsigned char bytes[1 << 16];
    size_t n = fill(bytes);
    for (size_t at = 0; at < n; at += 11) {
        bytes[at] ^= 0x41;
        spill(bytes, n);
        bytes[at] ^= 0x41;
        pal_study_journal *j = open_it(7, false);
        REQUIRE(j);
        int have = pal_study_journal_count(j, NULL);
        CHECK(have < RECORDS);
        for (int k = 0; k < have; k++) check_record(j, k);
        pal_study_journal_close(j);
    }
    /* where nothing can be written it says so */
    pal_study_journal *j = NULL;
    pal_diagnostic diag = {""};
    CHECK(pal_study_journal_open("/nowhere/study.reference", 7, false, &j, &diag) == PAL_ERR_IO && !j);
    CHECK(strstr(diag.text, "/nowhere/study.reference") != NULL);
}

int main(void)
{
    if (!mkdtemp(folder)) return 1;
    snprintf(path, sizeof path, "%s/study.reference", folder);
    RUN(what_is_kept_comes_back_with_its_bits);
    RUN(a_file_that_ends_anywhere_goes_on_behind_its_last_whole_record);
    RUN(a_byte_that_was_changed_ends_it_there);
    unlink(path);
    rmdir(folder);
    return check_report();
}
