// SPDX-License-Identifier: GPL-3.0-or-later
// The settings of one board where it stands: how it is wired and reached (`C:key,value`). They are
// taken only from a host on a cable of the board's own (Port::may_configure()), for whoever sets
// them takes the board over.
//
//     key        value                 default  meaning
//     network    name, 1-32 bytes      off      the WiFi network to join; `off`: none. Another name
//                                               forgets the password
//     password   8-63 bytes            off      of that network; `off`: it is open
//     host       a.b.c.d               off      what is for everyone goes to its port 2390, also
//                                               before it was heard (the paper's client); `off`: to
//                                               the host heard last
//     port       1-65535               2018     where the board listens for UDP
//     node       0-31                  1        its number on the CAN bus
//     chips      0-31                  31       which chips are fitted: 1 OSMC, 2 DHB12, 4
//                                               expander, 8 DAC, 16 servos
//     name       1-31 of A-Z a-z 0-9   off      what its owner calls it, told in its answer to
//                _ -                            `Q:ID`; `off`: it has no name
//     AIN24 …    volts, 0.01-650       50.00    of that analog input at full scale
//     key        id:64 hex digits      none     a key, of id 1-9 (key.hpp); `id:off`: it is none
//                                               any more. At most four
//
// In a name or password, what the grammar does not allow is written as in URLs: %2C is a comma, %25
// a percent sign, %6Fff the network that is called "off".
//
// network, password, host, port, name, key and analog inputs count at once, the others when the board
// starts next.
#pragma once

#include <cstddef>
#include <cstdint>

#include "r4link/key.hpp"
#include "r4link/state.hpp"
#include "r4link/text.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

constexpr std::size_t network_max = 32;
constexpr std::size_t password_min = 8;
constexpr std::size_t password_max = 63;
constexpr std::size_t board_name_max = 31;

struct SiteSettings {
  char network[network_max + 1] = {};    // ends in NUL; empty: off
  char password[password_max + 1] = {};  // likewise
  std::uint32_t host = 0;                // a.b.c.d, a in the highest byte; 0: off
  std::uint16_t udp_port = 2018;
  std::uint8_t can_node = 1;
  std::uint8_t chips = 31;
  char name[board_name_max + 1] = {};  // ends in NUL; empty: off
  std::uint16_t full_scale_cv[analog_channels] = {5000, 5000, 5000, 5000, 5000, 5000};
  Key keys[max_keys];  // those there are come first
};
bool operator==(const SiteSettings& a, const SiteSettings& b);

constexpr Text key_setting("key");

// True if the owner of a board may call it so: 1 to 31 letters, digits, _ and -.
bool is_board_name(Text text);
// The same of the id that it has of itself: 1 to 64 of them.
constexpr std::size_t board_id_max = 64;
bool is_board_id(Text text);

bool is_site_setting(Text key);
// True for `password` and `key`, whose values are for the board alone.
bool is_secret_setting(Text key);
// As set() of settings.hpp.
Refusal set(SiteSettings& settings, Text key, Text value);

// The longest text of a value: each byte of a password as %XX.
constexpr std::size_t max_site_value = 3 * password_max;
// The value of setting `index` (0 …) as set() takes it, in `out`; its key in `key`. False: there is
// no such setting. For keeping them, not for telling: the secret ones are among them.
bool get(const SiteSettings& settings, int index, Text& key, char (&out)[max_site_value],
         Text& value);

}  // namespace r4
