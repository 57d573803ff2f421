/* Members: names, places, and who holds which tool. */
#include "server/base/utf8.h"
#include "server/session/members.h"
#include "tests/check.h"

static pal_member_list list;

static int join(pal_member_role role, const char *name)
{
    int id = 0;
    return pal_members_join(&list, role, name, &id) ? 0 : id;
}
static const char *name_of(int id)
{
    pal_member_entry *member = pal_members_find(&list, id);
    return member ? member->name : "(nobody)";
}

static void names_are_made_unique_by_a_number(void)
{
    pal_members_init(&list, 3);
    CHECK_TEXT(name_of(join(PAL_MEMBER_TRAINEE, "Ann")), "Ann");
    CHECK_TEXT(name_of(join(PAL_MEMBER_TRAINEE, "Ann")), "Ann 2");
    CHECK_TEXT(name_of(join(PAL_MEMBER_TRAINEE, "Ann")), "Ann 3");
    CHECK_TEXT(name_of(join(PAL_MEMBER_TRAINEE, "Ann 2")), "Ann 2 2");
    CHECK_TEXT(name_of(join(PAL_MEMBER_VIEWER, "")), "guest");
    CHECK_TEXT(name_of(join(PAL_MEMBER_VIEWER, NULL)), "guest 2");
}

static void names_lose_control_and_direction_characters_and_broken_bytes(void)
{
    pal_members_init(&list, 3);
    CHECK_TEXT(name_of(join(PAL_MEMBER_TRAINEE, "  a\x01 \n b\x7f\t  c  ")), "a b c");
    CHECK_TEXT(name_of(join(PAL_MEMBER_TRAINEE, "J\xc3\xb6rg")), "J\xc3\xb6rg");
    CHECK_TEXT(name_of(join(PAL_MEMBER_TRAINEE, "x\xe2\x80\xaey")), "xy");             /* right-to-left override */
    CHECK_TEXT(name_of(join(PAL_MEMBER_TRAINEE, "\xc0\xafp\xff\xed\xa0\x80q")), "pq"); /* overlong, stray, surrogate */
    CHECK_TEXT(name_of(join(PAL_MEMBER_TRAINEE, "\xf4\x90\x80\x80r\xe2\x82")), "r");   /* beyond Unicode, cut */
    CHECK_TEXT(name_of(join(PAL_MEMBER_TRAINEE, "\x01\x02")), "guest");
}

static void a_long_name_is_cut_at_a_whole_character(void)
{
    pal_members_init(&list, 3);
    char name[400] = "";
    for (int k = 0; k < 60; k++) strcat(name, "\xe2\x82\xac");
    for (int k = 0; k < PAL_MEMBER_LIST_MAX; k++) {
        int id = join(PAL_MEMBER_INSTRUCTOR, name);
        REQUIRE(id > 0);
        const char *got = name_of(id);
        CHECK(strlen(got) < PAL_MEMBER_NAME);
        for (size_t at = 0, n; at < strlen(got); at += n) {
            uint32_t code;
            n = (size_t)pal_utf8_next(got + at, strlen(got) - at, &code);
            REQUIRE(n > 0);
        }
        for (int other = 1; other < id; other++) CHECK(strcmp(name_of(other), got) != 0);
    }
}

/* a trainee whose name reads as the instructor's gives orders that everybody takes for the instructor's */
static void a_name_that_looks_like_another_gets_a_number(void)
{
    static const char *const alike[] = {"Ada",
                                        "\xd0\x90"
                                        "da",
                                        "ADA",
                                        "Ada\xc2\xa0",
                                        "Ada\xf3\xa0\x81\xa1",
                                        "A\xc2\xad"
                                        "da"};
    pal_members_init(&list, 3);
    for (size_t k = 0; k < sizeof alike / sizeof *alike; k++) {
        const char *name = name_of(join(PAL_MEMBER_TRAINEE, alike[k]));
        char number[8] = "";
        if (k > 0) snprintf(number, sizeof number, " %zu", k + 1);
        if (strlen(name) < strlen(number) || strcmp(name + strlen(name) - strlen(number), number) != 0)
            CHECK_FAIL("%zu: %s", k, name);
    }
    CHECK_TEXT(name_of(join(PAL_MEMBER_TRAINEE, "Bob Illi")), "Bob Illi");
    CHECK_TEXT(name_of(join(PAL_MEMBER_TRAINEE, "B0b l111")), "B0b l111 2");
    CHECK_TEXT(name_of(join(PAL_MEMBER_TRAINEE, "\xd0\x90\xd0\xbd\xd0\xbd\xd0\xb0")),
               "\xd0\x90\xd0\xbd\xd0\xbd\xd0\xb0");
}

/* clients find themselves by their id, 16 bits on the wire: 65,534 joins once gave a stranger another's */
static void an_id_in_use_is_not_given_again(void)
{
    pal_members_init(&list, 3);
    const int ada = join(PAL_MEMBER_TRAINEE, "Ada");
    for (int k = 0; k < 2 * PAL_MEMBER_ID_MAX; k++) {
        const int id = join(PAL_MEMBER_VIEWER, "v");
        if (id == ada || id < 1 || id > PAL_MEMBER_ID_MAX) CHECK_FAIL("join %d has id %d", k, id);
        pal_members_leave(&list, id);
    }
    CHECK_TEXT(name_of(ada), "Ada");
}

static void a_full_table_refuses_and_an_id_is_never_used_twice(void)
{
    pal_members_init(&list, 3);
    const int kept = PAL_MEMBER_INSTRUCTORS;
    for (int k = 0; k < PAL_MEMBER_LIST_MAX - kept; k++) CHECK_INT(join(PAL_MEMBER_VIEWER, "v"), k + 1);
    int id = -5;
    CHECK_INT(pal_members_join(&list, PAL_MEMBER_TRAINEE, "one more", &id), PAL_ERR_FULL);
    CHECK_INT(id, -5);
    for (int k = 0; k < kept; k++) CHECK(join(PAL_MEMBER_INSTRUCTOR, "i") > 0);
    CHECK_INT(pal_members_join(&list, PAL_MEMBER_INSTRUCTOR, "one more", &id), PAL_ERR_FULL);
    pal_members_leave(&list, 7);
    CHECK_INT(list.n_member, PAL_MEMBER_LIST_MAX - 1);
    CHECK_INT(join(PAL_MEMBER_INSTRUCTOR, "new"), PAL_MEMBER_LIST_MAX + 1);
    CHECK(pal_members_find(&list, 7) == NULL);
    CHECK(pal_members_find(&list, 0) == NULL);
    pal_members_leave(&list, 7);
    CHECK_INT(list.n_member, PAL_MEMBER_LIST_MAX);
}

static void a_tool_has_one_holder(void)
{
    pal_members_init(&list, 2);
    int ann = join(PAL_MEMBER_TRAINEE, "Ann"), bob = join(PAL_MEMBER_INSTRUCTOR, "Bob"),
        eve = join(PAL_MEMBER_TRAINEE, "Eve"), tool = -9;
    CHECK_INT(pal_members_take_tool(&list, ann, 1, &tool), PAL_ERR_OK);
    CHECK_INT(tool, 1);
    CHECK_INT(pal_members_take_tool(&list, bob, 1, &tool), PAL_ERR_STATE);
    CHECK_INT(pal_members_take_tool(&list, bob, -1, &tool), PAL_ERR_OK);
    CHECK_INT(tool, 0);
    CHECK_INT(pal_members_take_tool(&list, eve, -1, &tool), PAL_ERR_STATE);
    CHECK_INT(pal_members_take_tool(&list, ann, -1, &tool), PAL_ERR_OK); /* keeps the one held */
    CHECK_INT(tool, 1);
    pal_members_leave(&list, bob);
    CHECK_INT(pal_members_take_tool(&list, ann, 0, &tool), PAL_ERR_OK); /* gives back 1 */
    CHECK_INT(list.holder[0], ann);
    CHECK_INT(list.holder[1], 0);
    pal_members_release_tool(&list, ann);
    pal_members_release_tool(&list, ann);
    CHECK_INT(list.holder[0], 0);
    CHECK_INT(pal_members_find(&list, ann)->tool, -1);
}

static void viewers_hold_nothing(void)
{
    pal_members_init(&list, 2);
    int vic = join(PAL_MEMBER_VIEWER, "Vic"), ann = join(PAL_MEMBER_TRAINEE, "Ann"), tool = 4;
    CHECK_INT(pal_members_take_tool(&list, vic, -1, &tool), PAL_ERR_REFUSED);
    CHECK_INT(pal_members_take_tool(&list, ann, 2, &tool), PAL_ERR_REFUSED);
    CHECK_INT(pal_members_take_tool(&list, ann, -2, &tool), PAL_ERR_REFUSED);
    CHECK_INT(pal_members_take_tool(&list, 99, 0, &tool), PAL_ERR_REFUSED);
    CHECK_INT(tool, 4);
}

int main(void)
{
    RUN(names_are_made_unique_by_a_number);
    RUN(names_lose_control_and_direction_characters_and_broken_bytes);
    RUN(a_long_name_is_cut_at_a_whole_character);
    RUN(a_name_that_looks_like_another_gets_a_number);
    RUN(an_id_in_use_is_not_given_again);
    RUN(a_full_table_refuses_and_an_id_is_never_used_twice);
    RUN(a_tool_has_one_holder);
    RUN(viewers_hold_nothing);
    return check_report();
}
