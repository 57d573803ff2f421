/* Sample files: what is written reads back bit by bit, every fault has its sentence with line and column, and the error
 * measure is that of the references' README. */
#include "server/solve/sample_points.h"
#include "tests/check.h"

static void expect_refusal(const char *text, const char *sentence)
{
    pal_samples s = {0};
    pal_diagnostic diag = {""};
    CHECK_INT(pal_samples_parse("u.csv", (const uint8_t *)text, strlen(text), &s, &diag), PAL_ERR_REFUSED);
    CHECK(s.x == NULL && s.u == NULL && s.n == 0);
    if (!strstr(diag.text, sentence)) CHECK_FAIL("\"%s\" does not say \"%s\"", diag.text, sentence);
    if (strncmp(diag.text, "u.csv: line ", 12) != 0) CHECK_FAIL("\"%s\" does not name file and line", diag.text);
}

static void every_fault_is_named_with_line_and_column(void)
{
    expect_refusal("", "line 1: empty");
    expect_refusal("\n\n", "line 2: empty");
    expect_refusal("x,y,z,ux,uy,uz\n", "line 1: no row");
    expect_refusal("x,y,z,ux,uy\n", "line 1: 5 columns, wanted 6");
    expect_refusal("x,y,z,ux,uz,uy\n1,2,3,4,5,6\n", "line 1: column 5 is \"uz\", wanted \"uy\"");
    expect_refusal("X,y,z,ux,uy,uz\n", "line 1: column 1 is \"X\", wanted \"x\"");
    expect_refusal("x;y;z;ux;uy;uz\n", "line 1: column 1 is \"x;y;z;ux;uy;uz\", wanted \"x\"");
    expect_refusal("1,2,3,4,5,6\n", "line 1: column 1 is \"1\"");
    expect_refusal("x,y,z,ux,uy,uz,t\n", "line 1: column 7, \"t\", is one too many");
    expect_refusal("x,y,z,ux,uy,uz\n1,2,3,4,5\n", "line 2: 5 columns, wanted 6");
    expect_refusal("x,y,z,ux,uy,uz\n1,2,3,4,5,6,7\n", "line 2: column 7, \"7\", is one too many");
    expect_refusal("x,y,z,ux,uy,uz\n\n1,2,three,4,5,6\n", "line 3: column 3 (z): \"three\" is not a number");
    expect_refusal("x,y,z,ux,uy,uz\n1,2,3,4,,6\n", "line 2: column 5 (uy): \"\" is not a number");
    expect_refusal("x,y,z,ux,uy,uz\n1,2,3,4,nan,6\n", "line 2: column 5 (uy): \"nan\" is not a number");
    expect_refusal("x,y,z,ux,uy,uz\n1,2,3,4,5,1e999\n", "line 2: column 6 (uz): \"1e999\" is not a number");
    expect_refusal("x,y,z,ux,uy,uz\n1,2,3,4,5,6x\n", "line 2: column 6 (uz): \"6x\" is not a number");
    expect_refusal("x,y,z,ux,uy,uz\n1,2,3,4,5,\x01\x02\n", "column 6 (uz): \"??\" is not a number");
}

static void other_line_ends_and_blanks_are_fine(void)
{
    static const char text[] = "\xef\xbb\xbf x , y,z,ux,uy,uz \r\n\r\n 1, 2 ,3,4e-1,5,-6\r\n7,8,9,10,11,12";
    pal_samples s = {0};
    pal_diagnostic diag = {""};
    REQUIRE(!pal_samples_parse("u.csv", (const uint8_t *)text, sizeof text - 1, &s, &diag));
    CHECK_INT(s.n, 2);
    CHECK_NEAR(s.x[1], 2, 0);
    CHECK_NEAR(s.u[0], 0.4, 0);
    CHECK_NEAR(s.u[2], -6, 0);
    CHECK_NEAR(s.x[3], 7, 0);
    CHECK_NEAR(s.u[5], 12, 0);
    pal_samples_free(&s);
}

static void what_is_written_reads_back_bit_by_bit(void)
{
    enum { N = 1000 };
    static double x[3 * N], u[3 * N];
    char path[] = "/tmp/palpate_samples_XXXXXX";
    int fd = mkstemp(path);
    pal_samples out = {.n = N, .x = x, .u = u}, back = {0};
    pal_diagnostic diag = {""};
    REQUIRE(fd >= 0);
    close(fd);
    for (int i = 0; i < 3 * N; i++) x[i] = sin(i * 1.7) * pow(10, i % 19 - 9), u[i] = cos(i * 0.3) / (1 + i);
    CHECK_INT(pal_samples_write(&out, path, &diag), PAL_ERR_OK);
    CHECK_INT(pal_samples_read(path, &back, &diag), PAL_ERR_OK);
    CHECK_INT(back.n, N);
    CHECK(back.n == N && !memcmp(back.x, x, sizeof x) && !memcmp(back.u, u, sizeof u));
    pal_samples_free(&back);
    unlink(path);
    CHECK_INT(pal_samples_read(path, &back, &diag), PAL_ERR_IO);
    CHECK(strstr(diag.text, path) != NULL);
    CHECK_INT(pal_samples_write(&out, "/nowhere/at/all.csv", &diag), PAL_ERR_IO);
}

static void error_is_over_the_largest_reference_displacement(void)
{
    double ref[] = {3, 0, 4, 0, 0, 0, 0, 0, 1}, u[] = {3, 0, 4, 0, 0.3, 0.4, 0, 0, 1}, rms, max;
    pal_samples s = {.n = 3, .x = ref, .u = ref};
    pal_samples_error(&s, u, &rms, &max);
    CHECK_NEAR(max, 10, 1e-12);             /* 0.5 of 5 */
    CHECK_NEAR(rms, 10 / sqrt(3.0), 1e-12); /* one of three points is off */
    pal_samples_error(&s, ref, &rms, &max);
    CHECK_NEAR(rms + max, 0, 0);
    double none[9] = {0};
    s.u = none;
    pal_samples_error(&s, none, &rms, &max);
    CHECK_NEAR(rms + max, 0, 0);
    pal_samples_error(&s, u, &rms, &max);
    CHECK(isinf(rms) && isinf(max));
}

int main(void)
{
    RUN(every_fault_is_named_with_line_and_column);
    RUN(other_line_ends_and_blanks_are_fine);
    RUN(what_is_written_reads_back_bit_by_bit);
    RUN(error_is_over_the_largest_reference_displacement);
    return check_report();
}
