// SPDX-License-Identifier: GPL-3.0-or-later
// The group whose members share a transport, besides the programs of the same user: ?share=GROUP, a
// group of the system's (group(5)).
#pragma once

#include "../share_name.hpp"
#include "../url.hpp"

namespace r4 {

// Takes `share` out of the URL; none where it is not in it. Throws Error{usage} for a group that is
// not there, and Error{permission} where this program's user is no member.
ShareGroup take_share_group(Url& url);

}  // namespace r4
