/* `palpate ticket`: makes keys and tickets. The ticket is printed alone, so that scripts can take it. */
#include "server/cli/report.h"
#include "server/commands/commands.h"
#include "server/net/admission/ticket_keys.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

static const char about[] =
    "Makes a ticket, which lets its bearer join the sessions of a server that was started with the same --keys.\n"
    "A browser takes it behind the # of the address, a client as PALPATE_TICKET or behind the # too. With --new-key\n"
    "it adds a key to the file instead. Tickets are signed with the last key of the file; a running server reads the\n"
    "file again when it has changed, so that a key is replaced by adding one and removing the old one later.\n";

typedef struct ticket_flags {
    const char *keys, *role, *session, *tool;
    double expires_s;
    int uses, user;
    bool new_key;
} ticket_flags;

static pal_err read_tool(const char *text, int *tool, pal_diagnostic *diag)
{
    int n = 0;
    if (!strcmp(text, "any")) return *tool = PAL_WIRE_TOOL_ANY, PAL_ERR_OK;
    if (!strcmp(text, "none")) return *tool = PAL_WIRE_TOOL_NONE, PAL_ERR_OK;
    if (sscanf(text, "%4d%n", tool, &n) == 1 && !text[n] && *tool >= 0 && *tool < PAL_WIRE_TOOL_MAX) return PAL_ERR_OK;
    return PAL_REFUSE(diag, "--tool %.20s: wanted any, none or a number from 0 to %d", text, PAL_WIRE_TOOL_MAX - 1);
}

static pal_err make_ticket(const ticket_flags *f, char text[PAL_TICKET_TEXT], pal_diagnostic *diag)
{
    pal_ticket_keys keys;
    pal_ticket ticket = {
        .uses = (uint16_t)f->uses, .user = (uint32_t)f->user, .session = pal_ticket_session(f->session)};
    int role = 0;
    while (role < PAL_WIRE_ROLE_COUNT && strcmp(pal_wire_role_name((pal_wire_role)role), f->role)) role++;
    if (role == PAL_WIRE_ROLE_COUNT)
        return PAL_REFUSE(diag, "--role %.20s: wanted viewer, trainee or instructor", f->role);
    ticket.role = (pal_wire_role)role;
    PAL_TRY(read_tool(f->tool, &ticket.tool, diag));
    PAL_TRY(pal_ticket_keys_read(f->keys, &keys, diag));
    PAL_TRY(pal_random_bytes(&ticket.nonce, sizeof ticket.nonce));
    const double end_s = f->expires_s > 0 ? ceil((double)time(NULL) + f->expires_s) : 0;
    if (end_s > UINT32_MAX) return PAL_REFUSE(diag, "--expires %g: tickets end before 2106; 0: never", f->expires_s);
    ticket.expires_s = (uint32_t)end_s;
    return pal_ticket_put(&ticket, &keys.key[keys.n - 1], text) ? PAL_ERR_OK : PAL_ERR_INTERNAL;
}

int command_ticket(int argc, char **argv)
{
    ticket_flags f = {.role = "trainee", .session = "", .tool = "any", .expires_s = 60, .uses = 1};
    pal_flag_common common;
    const pal_flag flag[] = {
        {"--keys", "FILE", PAL_FLAG_TEXT, &f.keys, 0, 0, "key file, which nobody else may read (needed)"},
        {"--role", "ROLE", PAL_FLAG_TEXT, &f.role, 0, 0, "viewer, trainee or instructor: the highest (trainee)"},
        {"--tool", "N", PAL_FLAG_TEXT, &f.tool, 0, 0, "the only tool that the bearer may hold, any, or none (any)"},
        {"--session", "NAME", PAL_FLAG_TEXT, &f.session, 0, 0, "the only session (any)"},
        {"--expires", "S", PAL_FLAG_NUMBER, &f.expires_s, 0, 4e9,
         "how long it admits, s; who is in stays, and may return after a loss; 0: for ever (60)"},
        {"--uses", "N", PAL_FLAG_COUNT, &f.uses, 0, UINT16_MAX, "how many members it admits; 0: any number (1)"},
        {"--user", "N", PAL_FLAG_COUNT, &f.user, 0, INT_MAX, "number of the bearer, of your own; 0: nobody's (0)"},
        {"--new-key", NULL, PAL_FLAG_SWITCH, &f.new_key, 0, 0, "add a key to the file, which is made when missing"},
    };
    const pal_flag_table table = {.usage = "ticket --keys FILE [flags]",
                                  .about = about,
                                  .example = "palpate ticket --keys tickets.keys --new-key\n"
                                             "palpate ticket --keys tickets.keys --role trainee --expires 28800\n",
                                  PAL_FLAGS(flag)};
    pal_diagnostic diag = {""};
    char text[PAL_TICKET_TEXT] = "";
    int id = 0, code = pal_flags_parse(&table, argc, argv, &common, NULL, NULL);
    if (code >= 0) return code;
    pal_err err = f.keys      ? PAL_ERR_OK
                  : f.new_key ? PAL_REFUSE(&diag, "--new-key needs --keys FILE, where the key is to stand")
                              : PAL_REFUSE(&diag, "a ticket needs --keys FILE with the key that signs it");
    if (!err) err = f.new_key ? pal_key_file_add(f.keys, &id, &diag) : make_ticket(&f, text, &diag);
    if (err) return pal_report_refusal(&common, err, &diag);
    if (common.json && f.new_key)
        return pal_report_json(&common, PAL_JSON({"ok", JSON_BOOL(true)}, {"key", JSON_NUMBER(id)}));
    if (common.json) return pal_report_json(&common, PAL_JSON({"ok", JSON_BOOL(true)}, {"ticket", JSON_TEXT(text)}));
    if (!f.new_key)
        printf("%s\n", text);
    else if (!common.quiet)
        printf("palpate: key %d was added to %s\n", id, f.keys);
    return 0;
}
