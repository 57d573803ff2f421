/* Who may come in: tickets, how many they admit, return, keys that are replaced, bans; and key files. */
#include "server/net/admission/admission.h"
#include "server/net/admission/ticket_keys.h"
#include "server/net/admission/tuning.h"
#include "tests/check.h"

#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define NOW_S 1700000000u
#define S     1000000000ull

static char keys_path[] = "/tmp/palpate_keys_XXXXXX";
static pal_ticket_keys keys;
static pal_admission *admission;
static uint64_t nonce;

static void begin(bool open)
{
    pal_diagnostic diag = {""};
    if (pal_admission_create(keys_path, open, &diag, &admission)) CHECK_FAIL("no admission: %s", diag.text);
    REQUIRE(!pal_ticket_keys_read(keys_path, &keys, &diag));
}

/* a ticket signed by the last key of the file */
static const char *sign(pal_ticket ticket)
{
    static char text[PAL_TICKET_TEXT];
    ticket.nonce = ticket.nonce ? ticket.nonce : ++nonce;
    CHECK(pal_ticket_put(&ticket, &keys.key[keys.n - 1], text));
    return text;
}

/* why a ticket is refused; "": it is not */
static const char *refusal(const char *text, uint64_t unix_s, uint64_t now_ns, pal_grant *grant)
{
    const char *why = pal_admission_check(admission, text, "liver", "192.0.2.1", unix_s, now_ns, grant);
    return why ? why : "";
}

static void without_a_ticket_one_watches(void)
{
    pal_grant grant;
    char text[PAL_TICKET_TEXT];
    begin(false);
    CHECK_TEXT(refusal("", NOW_S, 0, &grant), "");
    CHECK(grant.role == PAL_WIRE_ROLE_VIEWER && grant.tool == PAL_WIRE_TOOL_NONE && !grant.has_ticket);
    pal_admission_start_ticket(admission, PAL_WIRE_ROLE_INSTRUCTOR, text);
    CHECK_TEXT(refusal(text, NOW_S, 0, &grant), "");
    CHECK(grant.role == PAL_WIRE_ROLE_INSTRUCTOR && grant.tool == PAL_WIRE_TOOL_ANY && grant.has_ticket);
    text[10] = text[10] == 'A' ? 'B' : 'A';
    CHECK_TEXT(refusal(text, NOW_S, 0, &grant), "this ticket is not one of this server");
    pal_admission_destroy(admission);
    begin(true);
    CHECK_TEXT(refusal("", NOW_S, 0, &grant), "");
    CHECK_INT(grant.role, PAL_WIRE_ROLE_INSTRUCTOR);
    pal_admission_destroy(admission);
}

static void a_ticket_is_for_its_session_and_its_time(void)
{
    pal_grant grant;
    begin(false);
    CHECK_TEXT(
        refusal(sign((pal_ticket){.role = PAL_WIRE_ROLE_TRAINEE, .tool = 1, .session = pal_ticket_session("liver")}),
                NOW_S, 0, &grant),
        "");
    CHECK(grant.role == PAL_WIRE_ROLE_TRAINEE && grant.tool == 1);
    CHECK_TEXT(refusal(sign((pal_ticket){.session = pal_ticket_session("heart")}), NOW_S, 0, &grant),
               "this ticket is for another session");
    CHECK_TEXT(refusal(sign((pal_ticket){.expires_s = NOW_S}), NOW_S, 0, &grant), "");
    CHECK_TEXT(refusal(sign((pal_ticket){.expires_s = NOW_S}), NOW_S + 1, 0, &grant), "this ticket has expired");
    pal_admission_destroy(admission);
}

static void a_ticket_for_one_admits_one_who_may_return(void)
{
    pal_grant grant, other;
    const pal_ticket one = {.role = PAL_WIRE_ROLE_TRAINEE, .uses = 1, .expires_s = NOW_S + 60, .nonce = 77};
    uint64_t now = 1000 * S;
    begin(false);
    CHECK_TEXT(refusal(sign(one), NOW_S, now, &grant), "");
    CHECK_INT(pal_admission_enter(admission, &grant, now), PAL_ERR_OK);
    CHECK_TEXT(refusal(sign(one), NOW_S, now, &other), "");
    CHECK_INT(pal_admission_enter(admission, &other, now), PAL_ERR_FULL); /* a copy of it */
    /* an hour later the connection breaks: the ticket has expired, and its member returns */
    now += 3600 * S;
    pal_admission_leave(admission, &grant, now);
    now += PAL_RETURN_NS - S;
    CHECK_TEXT(refusal(sign(one), NOW_S + 3660, now, &grant), "");
    CHECK_INT(pal_admission_enter(admission, &grant, now), PAL_ERR_OK);
    pal_admission_leave(admission, &grant, now);
    now += PAL_RETURN_NS;
    CHECK_TEXT(refusal(sign(one), NOW_S + 3720, now, &grant), "this ticket has expired");
    /* and one that has not expired is used up */
    const pal_ticket lasting = {.role = PAL_WIRE_ROLE_TRAINEE, .uses = 1, .nonce = 78};
    CHECK_TEXT(refusal(sign(lasting), NOW_S, now, &grant), "");
    CHECK_INT(pal_admission_enter(admission, &grant, now), PAL_ERR_OK);
    pal_admission_leave(admission, &grant, now);
    CHECK_INT(pal_admission_enter(admission, &grant, now + PAL_RETURN_NS), PAL_ERR_FULL);
    pal_admission_destroy(admission);
}

/* on another server with the same keys, where nobody remembers that the member was in */
static void a_member_that_is_sent_elsewhere_is_let_in_there(void)
{
    pal_grant grant;
    char renewed[PAL_TICKET_TEXT];
    const pal_ticket ticket = {.role = PAL_WIRE_ROLE_TRAINEE,
                               .tool = 1,
                               .uses = 1,
                               .session = pal_ticket_session("liver"),
                               .user = 7,
                               .expires_s = NOW_S + 60,
                               .nonce = 99};
    const char *text = sign(ticket);
    begin(false);
    CHECK_TEXT(refusal(text, NOW_S, 0, &grant), "");
    pal_admission_renew(admission, &grant, NOW_S + 500, renewed);
    pal_admission_destroy(admission);
    begin(false);
    CHECK_TEXT(refusal(text, NOW_S + 500, 0, &grant), "this ticket has expired");
    CHECK_TEXT(refusal(renewed, NOW_S + 500 + 60, 0, &grant), "");
    CHECK(grant.role == ticket.role && grant.tool == 1 && grant.ticket.uses == 1 && grant.ticket.user == 7 &&
          grant.ticket.nonce == 99 && grant.ticket.session == ticket.session);
    CHECK_TEXT(refusal(renewed, NOW_S + 500 + 61, 0, &grant), "this ticket has expired");
    /* what holds longer, or for ever, is good as it is; who has none gets none */
    CHECK_TEXT(refusal(sign((pal_ticket){.expires_s = NOW_S + 600}), NOW_S, 0, &grant), "");
    pal_admission_renew(admission, &grant, NOW_S, renewed);
    CHECK_TEXT(renewed, "");
    CHECK_TEXT(refusal(sign((pal_ticket){.uses = 1}), NOW_S, 0, &grant), "");
    pal_admission_renew(admission, &grant, NOW_S, renewed);
    CHECK_TEXT(renewed, "");
    CHECK_TEXT(refusal("", NOW_S, 0, &grant), "");
    pal_admission_renew(admission, &grant, NOW_S, renewed);
    CHECK_TEXT(renewed, "");
    pal_admission_destroy(admission);
}

static void a_ban_is_of_a_personal_ticket_else_of_the_address(void)
{
    pal_grant grant;
    char start[PAL_TICKET_TEXT], teacher[PAL_TICKET_TEXT];
    const pal_ticket personal = {.role = PAL_WIRE_ROLE_TRAINEE, .user = 9, .nonce = 99};
    begin(false);
    CHECK_TEXT(refusal(sign(personal), NOW_S, 0, &grant), "");
    CHECK_INT(pal_admission_enter(admission, &grant, 0), PAL_ERR_OK);
    pal_admission_ban(admission, &grant);
    CHECK_TEXT(refusal(sign(personal), NOW_S, 0, &grant), "this ticket was banned");
    pal_admission_start_ticket(admission, PAL_WIRE_ROLE_TRAINEE, start);
    CHECK_TEXT(refusal(start, NOW_S, 0, &grant), ""); /* others of that address come in */
    CHECK_INT(pal_admission_enter(admission, &grant, 0), PAL_ERR_OK);
    pal_admission_ban(admission, &grant);
    CHECK_TEXT(refusal(start, NOW_S, 0, &grant), "this address was banned");
    CHECK_TEXT(refusal("", NOW_S, 0, &grant), "this address was banned");
    pal_admission_start_ticket(admission, PAL_WIRE_ROLE_INSTRUCTOR, teacher);
    CHECK_TEXT(refusal(teacher, NOW_S, 0, &grant), ""); /* nobody locks the instructors out */
    CHECK(pal_admission_check(admission, start, "liver", "192.0.2.2", NOW_S, 0, &grant) == NULL);
    pal_admission_destroy(admission);
}

/* the file is written as of another time, as a later change would be */
static void age_file(time_t s)
{
    const struct timespec times[2] = {{s, 0}, {s, 0}};
    CHECK_INT(utimensat(0, keys_path, times, 0), 0);
}

static void keys_are_replaced_while_the_server_runs(void)
{
    pal_grant grant;
    pal_diagnostic diag = {""};
    char old[PAL_TICKET_TEXT], text[128];
    int id = 0;
    age_file(1000);
    begin(false);
    strcpy(old, sign((pal_ticket){.role = PAL_WIRE_ROLE_TRAINEE}));
    CHECK_TEXT(refusal(old, NOW_S, 0, &grant), "");
    REQUIRE(!pal_key_file_add(keys_path, &id, &diag));
    CHECK_INT(id, 2);
    age_file(2000);
    REQUIRE(!pal_ticket_keys_read(keys_path, &keys, &diag));
    CHECK_INT(keys.n, 2);
    CHECK_TEXT(refusal(sign((pal_ticket){.role = PAL_WIRE_ROLE_TRAINEE}), NOW_S, 0, &grant), "");
    CHECK_INT(grant.ticket.key_id, 2);
    CHECK_TEXT(refusal(old, NOW_S, 0, &grant), "");
    /* the first one is taken away */
    FILE *file = fopen(keys_path, "w");
    fprintf(file, "# the newer key\n2 ");
    for (int i = 0; i < PAL_TICKET_KEY_BYTES; i++) fprintf(file, "%02X", keys.key[1].bytes[i]);
    fprintf(file, "\n");
    fclose(file);
    age_file(3000);
    CHECK_TEXT(refusal(old, NOW_S, 0, &grant), "this ticket is not one of this server");
    CHECK_TEXT(refusal(sign((pal_ticket){.role = PAL_WIRE_ROLE_TRAINEE}), NOW_S, 0, &grant), "");
    /* a file that others may read changes nothing in a server that runs, and starts none */
    chmod(keys_path, 0640);
    age_file(4000);
    CHECK_TEXT(refusal(sign((pal_ticket){.role = PAL_WIRE_ROLE_TRAINEE}), NOW_S, 0, &grant), "");
    snprintf(text, sizeof text, "%s may be read or written by others (mode 640): chmod 600 %s", keys_path, keys_path);
    CHECK_INT(pal_ticket_keys_read(keys_path, &keys, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, text);
    chmod(keys_path, 0600);
    pal_admission_destroy(admission);
}

static void wrong_key_files_name_the_line(void)
{
    static const char *const bad[] = {"1 00\n", "0 ", "256 ", "x\n", "1 zz"};
    pal_diagnostic diag = {""};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        FILE *file = fopen(keys_path, "w");
        fprintf(file, "\n%s%064d\n", bad[i], 0);
        fclose(file);
        CHECK_INT(pal_ticket_keys_read(keys_path, &keys, &diag), PAL_ERR_REFUSED);
        CHECK(strstr(diag.text, ": line 2 is not an id from 1 to 255 and 64 hexadecimal digits") != NULL);
    }
    FILE *file = fopen(keys_path, "w");
    fprintf(file, "3 %064d\n3 %064d\n", 0, 1);
    fclose(file);
    CHECK_INT(pal_ticket_keys_read(keys_path, &keys, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, ": line 2: key 3 comes twice") != NULL);
    CHECK_INT(pal_ticket_keys_read("/dev/zero", &keys, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "/dev/zero is no file");
    CHECK_INT(pal_ticket_keys_read("/no/such/keys", &keys, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "/no/such/keys cannot be opened: No such file or directory");
}

int main(void)
{
    pal_diagnostic diag = {""};
    int id = 0, fd = mkstemp(keys_path);
    if (fd < 0 || close(fd) || unlink(keys_path) || pal_key_file_add(keys_path, &id, &diag)) return 1;
    RUN(without_a_ticket_one_watches);
    RUN(a_ticket_is_for_its_session_and_its_time);
    RUN(a_ticket_for_one_admits_one_who_may_return);
    RUN(a_member_that_is_sent_elsewhere_is_let_in_there);
    RUN(a_ban_is_of_a_personal_ticket_else_of_the_address);
    RUN(keys_are_replaced_while_the_server_runs);
    RUN(wrong_key_files_name_the_line);
    unlink(keys_path);
    return check_report();
}
