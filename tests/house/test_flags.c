/* Flags and configuration: what each source may say, which one wins, and what is refused with which words. */
#include "server/cli/config.h"
#include "server/cli/report.h"
#include "tests/check.h"

#include <fcntl.h>

static double number;
static int count;
static bool on;
static const char *text;
static double vector[3];
static pal_config config;
static pal_flag_common common;
static const char *operand[2];
static int n_operand;
static char output[4096]; /* what went to stderr */

/* parses words (ended by NULL) with stderr caught; the result is the parser's */
static int parse(bool with_config, char **word)
{
    const pal_flag flag[] = {{"--number", "X", PAL_FLAG_NUMBER, &number, -2, 5, "a number"},
                             {"--count", "N", PAL_FLAG_COUNT, &count, 1, 9, "a count"},
                             {"--on", NULL, PAL_FLAG_SWITCH, &on, 0, 0, "a switch"},
                             {"--vector", "X,Y,Z", PAL_FLAG_VECTOR, vector, 0, 0, "three numbers"},
                             {"-o", "TEXT", PAL_FLAG_TEXT, &text, 0, 0, "a text"}};
    const pal_flag_table table = {.usage = "try", .about = "", PAL_FLAGS(flag), .operands = {0, 2}};
    int argc = 0;
    while (word[argc]) argc++;
    number = 1, count = 2, on = false, text = NULL, n_operand = 0;
    FILE *file = tmpfile();
    int old = dup(STDERR_FILENO);
    if (!file || old < 0) return -100;
    fflush(stderr);
    dup2(fileno(file), STDERR_FILENO);
    int code = with_config ? pal_config_parse_flags(&table, &config, argc, word, &common, operand, &n_operand)
                           : pal_flags_parse(&table, argc, word, &common, operand, &n_operand);
    fflush(stderr);
    dup2(old, STDERR_FILENO);
    close(old);
    rewind(file);
    size_t n = fread(output, 1, sizeof output - 1, file);
    output[n] = 0;
    fclose(file);
    return code;
}
#define PARSE(...)     parse(false, (char *[]){"try", __VA_ARGS__, NULL})
#define CONFIGURE(...) parse(true, (char *[]){"try", __VA_ARGS__, NULL})
#define WRONG(call, part)                                                                                              \
    do {                                                                                                               \
        CHECK_INT(call, 2);                                                                                            \
        CHECK(strchr(output, '\n') == output + strlen(output) - 1);                                                    \
        if (!strstr(output, part)) CHECK_FAIL("\"%s\" does not say \"%s\"", output, part);                             \
    } while (0)

static void values_may_stand_apart_or_behind_an_equal_sign(void)
{
    CHECK_INT(PARSE("a", "--number", "-1.5", "--count=7", "b", "--on", "-o", "-dash", "--json"), -1);
    CHECK_NEAR(number, -1.5, 0);
    CHECK_INT(count, 7);
    CHECK(on && common.json && !common.quiet);
    CHECK_TEXT(text, "-dash");
    CHECK_INT(n_operand, 2);
    CHECK_TEXT(operand[1], "b");
    CHECK_TEXT(common.program, "palpate try");
    CHECK_TEXT(output, "");
    CHECK_INT(PARSE("--quiet", "--", "--on", "-"), -1);
    CHECK(!on && common.quiet);
    CHECK_TEXT(operand[0], "--on");
    CHECK_INT(PARSE("-"), -1);
    CHECK_INT(n_operand, 1);
    CHECK_INT(PARSE("--vector", "1,-2,3e-1"), -1);
    CHECK(vector[0] == 1 && vector[1] == -2 && vector[2] == 0.3);
    CHECK_INT(PARSE("-o="), -1);
    CHECK_TEXT(text, "");
}

static void what_is_wrong_is_said_in_one_line_with_the_flag_and_the_range(void)
{
    WRONG(PARSE("--nmber", "3"), "unknown flag --nmber");
    WRONG(PARSE("--number=6"), "--number: 6 is outside -2 .. 5");
    WRONG(PARSE("--number", "3x"), "--number: \"3x\" is not a number");
    WRONG(PARSE("--number", ""), "is not a number");
    WRONG(PARSE("--number", " 3"), "is not a number");
    WRONG(PARSE("--number", "inf"), "is not a number");
    WRONG(PARSE("--number", "1e999"), "is not a number");
    WRONG(PARSE("--count", "1.5"), "1.5 is not a whole number");
    WRONG(PARSE("--count", "99999999999"), "--count: 99999999999 is outside 1 .. 9");
    WRONG(PARSE("--count"), "--count needs a value");
    WRONG(PARSE("--vector", "1,2"), "--vector: \"1,2\" is not three numbers X,Y,Z");
    WRONG(PARSE("--vector", "1,2,3,4"), "is not three numbers");
    WRONG(PARSE("--vector=1,2,nan"), "is not three numbers");
    WRONG(PARSE("--on=1"), "--on takes no value");
    WRONG(PARSE("--on", "--on"), "--on is given twice");
    WRONG(PARSE("a", "b", "c"), "\"c\" is one operand too many");
    WRONG(PARSE("--port", "80"), "unknown flag --port");
    WRONG(PARSE("--x\ny"), "unknown flag --x y");
}

static void flags_win_over_environment_over_file_over_defaults(void)
{
    char path[] = "/tmp/palpate_config_XXXXXX";
    int file = mkstemp(path);
    static const char json[] = "{\"port\": 1111, \"max_clients\": 7, \"log\": \"debug\", \"allow_remote\": true}";
    REQUIRE(file >= 0);
    REQUIRE(write(file, json, sizeof json - 1) == (ssize_t)(sizeof json - 1));
    close(file);
    CHECK_INT(CONFIGURE("a"), -1);
    CHECK_INT(config.port, 8090);
    CHECK_TEXT(config.listen, "127.0.0.1");
    CHECK(!config.allow_remote);
    CHECK_INT(config.max_clients, 200);
    CHECK_INT(config.max_viewers, 1000);
    CHECK_INT(pal_config_log_level(&config), PAL_LOG_INFO);
    setenv("PALPATE_PORT", "2222", 1);
    setenv("PALPATE_ALLOW_REMOTE", "false", 1);
    CHECK_INT(CONFIGURE("a", "--config", path), -1);
    CHECK_INT(config.port, 2222);
    CHECK_INT(config.max_clients, 7);
    CHECK(!config.allow_remote);
    CHECK_INT(pal_config_log_level(&config), PAL_LOG_DEBUG);
    CHECK_INT(CONFIGURE("a", "--port", "3333", "--config", path, "--allow-remote"), -1);
    CHECK_INT(config.port, 3333);
    CHECK(config.allow_remote);
    setenv("PALPATE_CONFIG", path, 1);
    CHECK_INT(CONFIGURE("a"), -1);
    CHECK_INT(config.max_clients, 7);
    unsetenv("PALPATE_CONFIG");
    setenv("PALPATE_PORT", "x", 1);
    CHECK_INT(CONFIGURE("a"), 1);
    CHECK(strstr(output, "PALPATE_PORT: \"x\" is not a number") != NULL);
    unsetenv("PALPATE_PORT");
    unsetenv("PALPATE_ALLOW_REMOTE");
    WRONG(CONFIGURE("--port", "1", "--port", "2"), "--port is given twice");
    WRONG(CONFIGURE("--max-clients", "0"), "--max-clients: 0 is outside 1 .. 10000");
    WRONG(CONFIGURE("--log", "loud"), "--log: \"loud\" is not error, warn, info or debug");
    WRONG(CONFIGURE("--listen", ""), "--listen: is empty");
    CHECK_INT(CONFIGURE("--config", "/no/such.json"), 1);
    CHECK(strstr(output, "/no/such.json") != NULL);
    unlink(path);
}

static void a_bad_file_changes_nothing_and_names_file_and_key(void)
{
    static const struct {
        const char *json, *sentence;
    } bad[] = {{"", "c.json: line 1: not JSON"},
               {"{\n\"port\": 1,\n}", "c.json: line 3: not JSON"},
               {"[]", "c.json: not a JSON object"},
               {"{} x", "c.json: line 1: not JSON"},
               {"{\"prot\": 1}", "c.json: prot: unknown key"},
               {"{\"port\": 1, \"port\": 2}", "c.json: port: the key is given twice"},
               {"{\"max_clients\": 3, \"port\": -1}", "c.json: port: -1 is outside 0 .. 65535"},
               {"{\"port\": 80.5}", "c.json: port: 80.5 is not a whole number"},
               {"{\"port\": \"80\"}", "c.json: port: is not a number"},
               {"{\"allow_remote\": 1}", "c.json: allow_remote: is not true or false"},
               {"{\"listen\": 1}", "c.json: listen: is not a text"},
               {"{\"viewer\": \"a\\u0001\"}", "c.json: viewer: has a control character"},
               {"{\"error_m\": 1}", "c.json: error_m: 1 is outside 0 .. 0.01"}};
    pal_config_default(&config);
    pal_config before = config;
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++) {
        pal_diagnostic diag = {""};
        CHECK_INT(pal_config_parse(&config, "c.json", bad[k].json, strlen(bad[k].json), &diag), PAL_ERR_REFUSED);
        CHECK_TEXT(diag.text, bad[k].sentence);
        CHECK(!memcmp(&before, &config, sizeof config));
    }
    char *variable[] = {"HOME=/", "PALPATE_MAX_CLIENTS=5", "PALPATE_PORT=70000", NULL};
    pal_diagnostic diag = {""};
    CHECK_INT(pal_config_environment(&config, variable, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "PALPATE_PORT: 70000 is outside 0 .. 65535");
    CHECK_INT(config.max_clients, 200);
}

static void long_texts_are_refused(void)
{
    char long_text[400];
    pal_diagnostic diag = {""};
    memset(long_text, 'a', sizeof long_text - 1);
    long_text[sizeof long_text - 1] = 0;
    pal_config_default(&config);
    CHECK_INT(pal_config_set(&config, "viewer", long_text, "--viewer", &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "--viewer: 399 bytes of text, more than 255");
    CHECK_INT(pal_config_set(&config, "log", long_text, "--log", &diag), PAL_ERR_REFUSED);
    long_text[255] = 0;
    CHECK_INT(pal_config_set(&config, "viewer", long_text, "--viewer", &diag), 0);
    CHECK_INT(strlen(config.viewer), 255);
}

int main(void)
{
    RUN(values_may_stand_apart_or_behind_an_equal_sign);
    RUN(what_is_wrong_is_said_in_one_line_with_the_flag_and_the_range);
    RUN(flags_win_over_environment_over_file_over_defaults);
    RUN(a_bad_file_changes_nothing_and_names_file_and_key);
    RUN(long_texts_are_refused);
    return check_report();
}
