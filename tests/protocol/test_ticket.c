/* Tickets: the layout by a text that another program signed, and refusals of everything that is not exactly one. */
#include "protocol/ticket.h"
#include "tests/check.h"

static pal_ticket_key key_of(uint8_t id)
{
    pal_ticket_key key = {.id = id};
    for (int i = 0; i < PAL_TICKET_KEY_BYTES; i++) key.bytes[i] = (uint8_t)i;
    return key;
}

static pal_ticket example(void)
{
    return (pal_ticket){.key_id = 7,
                        .role = PAL_WIRE_ROLE_TRAINEE,
                        .tool = 2,
                        .uses = 3,
                        .session = pal_ticket_session("liver"),
                        .user = 42,
                        .expires_s = 1800000000,
                        .nonce = 0x0123456789abcdef};
}

/* Python: base64.urlsafe_b64encode(b + hmac.new(bytes(range(32)), b, "sha256").digest()), where
 * b = struct.pack("<BBBbHQIIQ", 1, 7, 1, 2, 3, first eight bytes of sha256(b"liver"), 42, 1800000000, nonce) */
static const char signed_elsewhere[] =
    "AQcBAgMA669IqXJXleoqAAAAANJJa-_Nq4lnRSMBUEp1D5O_J5qG5TAA6x2ZvY3J_OddOK28FYjZT453Q5o";

static void writes_and_reads_what_another_program_signs(void)
{
    const pal_ticket_key key[2] = {key_of(1), key_of(7)};
    const pal_ticket wanted = example();
    char text[PAL_TICKET_TEXT];
    pal_ticket read;
    CHECK(pal_ticket_put(&wanted, &key[1], text));
    CHECK(!strcmp(text, signed_elsewhere));
    CHECK(pal_ticket_get(text, key, 2, &read));
    CHECK_INT(read.key_id, 7);
    CHECK_INT(read.role, PAL_WIRE_ROLE_TRAINEE);
    CHECK_INT(read.tool, 2);
    CHECK_INT(read.uses, 3);
    CHECK(read.session == wanted.session);
    CHECK_INT(read.user, 42);
    CHECK_INT(read.expires_s, 1800000000);
    CHECK(read.nonce == wanted.nonce);
    CHECK(!pal_ticket_get(text, key, 1, &read)); /* its key has been taken away */
}

static void refuses_every_other_text(void)
{
    const pal_ticket_key key = key_of(7);
    pal_ticket read;
    char text[PAL_TICKET_TEXT + 1];
    /* every bit of the 62 bytes: the last of the 83 characters has two bits of padding, which say nothing */
    for (int i = 0; i < PAL_TICKET_TEXT - 1; i++)
        for (int c = 1; c < 128; c++) {
            memcpy(text, signed_elsewhere, sizeof signed_elsewhere);
            if (text[i] == c || (i == PAL_TICKET_TEXT - 2 && strchr("opqr", c))) continue;
            text[i] = (char)c;
            CHECK(!pal_ticket_get(text, &key, 1, &read));
        }
    snprintf(text, sizeof text, "%sA", signed_elsewhere);
    CHECK(!pal_ticket_get(text, &key, 1, &read));
    CHECK(!pal_ticket_get("", &key, 1, &read));
}

static void refuses_fields_out_of_range(void)
{
    const pal_ticket_key key = key_of(7);
    char text[PAL_TICKET_TEXT];
    pal_ticket ticket = example();
    ticket.role = PAL_WIRE_ROLE_COUNT;
    CHECK(!pal_ticket_put(&ticket, &key, text));
    ticket = example(), ticket.tool = PAL_WIRE_TOOL_MAX;
    CHECK(!pal_ticket_put(&ticket, &key, text));
    ticket.tool = PAL_WIRE_TOOL_NONE - 1;
    CHECK(!pal_ticket_put(&ticket, &key, text));
}

int main(void)
{
    RUN(writes_and_reads_what_another_program_signs);
    RUN(refuses_every_other_text);
    RUN(refuses_fields_out_of_range);
    return check_report();
}
