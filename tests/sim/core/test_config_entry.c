/* Scene entries: keys are typed, read once, and unknown ones refused by name. */
#include "server/sim/core/config_entry.h"
#include "tests/check.h"

static pal_config_entry item;
static pal_diagnostic diag;

static void reads_each_kind_of_value(void)
{
    const double list[3] = {1, 2, 3};
    double number = 0, numbers[3];
    bool flag = false;
    const char *text = NULL;
    int count = 0;
    pal_entry_init(&item, "effects[2]", "gravity");
    CHECK_INT(pal_entry_put_number(&item, "a", 0.25, &diag), 0);
    CHECK_INT(pal_entry_put_bool(&item, "b", true, &diag), 0);
    CHECK_INT(pal_entry_put_text(&item, "c", "soft", &diag), 0);
    CHECK_INT(pal_entry_put_numbers(&item, "d", list, 3, &diag), 0);
    CHECK_INT(pal_entry_put_number(&item, "e", 7, &diag), 0);
    CHECK_INT(pal_entry_read_number(&item, "a", 0, 1, &number, &diag), 0);
    CHECK_INT(pal_entry_read_bool(&item, "b", &flag, &diag), 0);
    CHECK_INT(pal_entry_read_text(&item, "c", &text, &diag), 0);
    CHECK_INT(pal_entry_read_numbers(&item, "d", 3, numbers, &diag), 0);
    CHECK_INT(pal_entry_read_count(&item, "e", 0, 10, &count, &diag), 0);
    CHECK_NEAR(number, 0.25, 0);
    CHECK(flag);
    CHECK_TEXT(text, "soft");
    CHECK_NEAR(numbers[2], 3, 0);
    CHECK_INT(count, 7);
    CHECK_INT(pal_entry_check_unused(&item, &diag), 0);
}

static void keeps_the_default_of_an_absent_key(void)
{
    double number = 42;
    pal_entry_init(&item, "model", "tet_springs");
    CHECK_INT(pal_entry_read_number(&item, "k_distance_J", 0, 1, &number, &diag), 0);
    CHECK_NEAR(number, 42, 0);
    CHECK(!pal_entry_has(&item, "k_distance_J"));
}

static void refuses_numbers_out_of_range_by_path_and_number(void)
{
    double number = 1;
    pal_entry_init(&item, "effects[3]", "tool_push");
    pal_entry_put_number(&item, "stiffness_N_m", -5, NULL);
    pal_entry_put_number(&item, "nan", NAN, NULL);
    CHECK_INT(pal_entry_read_number(&item, "stiffness_N_m", 0, 1e4, &number, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "effects[3].stiffness_N_m: -5 is outside [0, 10000]");
    CHECK_INT(pal_entry_read_number(&item, "nan", -1, 1, &number, &diag), PAL_ERR_REFUSED);
    CHECK_NEAR(number, 1, 0);
}

static void refuses_another_kind_of_value(void)
{
    int count = 1;
    double numbers[2];
    pal_entry_init(&item, "output", "skin_output");
    pal_entry_put_text(&item, "a", "five", NULL);
    pal_entry_put_number(&item, "b", 1.5, NULL);
    pal_entry_put_numbers(&item, "c", (const double[]){1, INFINITY}, 2, NULL);
    CHECK_INT(pal_entry_read_count(&item, "a", 0, 9, &count, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "output.a: is a text, wanted a number");
    CHECK_INT(pal_entry_read_count(&item, "b", 0, 9, &count, &diag), PAL_ERR_REFUSED);
    CHECK_INT(pal_entry_read_numbers(&item, "c", 3, numbers, &diag), PAL_ERR_REFUSED);
    CHECK_INT(pal_entry_read_numbers(&item, "c", 2, numbers, &diag), PAL_ERR_REFUSED);
    CHECK_INT(count, 1);
}

static void refuses_the_first_key_that_nobody_read(void)
{
    double number = 0;
    pal_entry_init(&item, "effects[0]", "gravity");
    pal_entry_put_number(&item, "acceleration_m_s2", 1, NULL);
    pal_entry_put_number(&item, "acceleraton_m_s2", 1, NULL);
    pal_entry_read_number(&item, "acceleration_m_s2", 0, 10, &number, NULL);
    CHECK_INT(pal_entry_check_unused(&item, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "effects[0] (gravity): unknown key \"acceleraton_m_s2\"");
}

static void refuses_a_key_twice_too_long_or_too_many(void)
{
    char name[PAL_ENTRY_TEXT + 1];
    pal_entry_init(&item, "model", "tet_springs");
    CHECK_INT(pal_entry_put_bool(&item, "a", true, NULL), 0);
    CHECK_INT(pal_entry_put_number(&item, "a", 1, NULL), PAL_ERR_REFUSED);
    memset(name, 'x', PAL_ENTRY_TEXT);
    name[PAL_ENTRY_TEXT] = 0;
    CHECK_INT(pal_entry_put_number(&item, name, 1, NULL), PAL_ERR_REFUSED);
    CHECK_INT(pal_entry_put_number(&item, "", 1, NULL), PAL_ERR_REFUSED);
    CHECK_INT(pal_entry_put_text(&item, "t", name, NULL), PAL_ERR_REFUSED);
    CHECK_INT(pal_entry_put_numbers(&item, "n", (double[17]){0}, 17, NULL), PAL_ERR_REFUSED);
    for (int i = 1; i < PAL_ENTRY_KEYS; i++) {
        snprintf(name, sizeof name, "k%d", i);
        CHECK_INT(pal_entry_put_number(&item, name, i, NULL), 0);
    }
    CHECK_INT(pal_entry_put_number(&item, "last", 1, NULL), PAL_ERR_REFUSED);
}

int main(void)
{
    RUN(reads_each_kind_of_value);
    RUN(keeps_the_default_of_an_absent_key);
    RUN(refuses_numbers_out_of_range_by_path_and_number);
    RUN(refuses_another_kind_of_value);
    RUN(refuses_the_first_key_that_nobody_read);
    RUN(refuses_a_key_twice_too_long_or_too_many);
    return check_report();
}
