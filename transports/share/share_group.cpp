// SPDX-License-Identifier: GPL-3.0-or-later
#include "share_group.hpp"

#include <grp.h>
#include <unistd.h>

#include <algorithm>
#include <climits>
#include <optional>
#include <vector>

namespace r4 {
namespace {

std::optional<gid_t> id_of(const std::string& name) {
  group entry{};
  group* found = nullptr;
  std::vector<char> room(1 << 20);  // a group may have thousands of members
  ::getgrnam_r(name.c_str(), &entry, room.data(), room.size(), &found);
  return found == nullptr ? std::nullopt : std::optional(entry.gr_gid);
}

bool is_ours(gid_t group) {
  if (::geteuid() == 0 || ::getegid() == group) return true;
  std::vector<gid_t> groups(NGROUPS_MAX);
  groups.resize(static_cast<std::size_t>(std::max(0, ::getgroups(NGROUPS_MAX, groups.data()))));
  return std::find(groups.begin(), groups.end(), group) != groups.end();
}

}  // namespace

ShareGroup take_share_group(Url& url) {
  const std::optional<std::string> name = url.take("share");
  if (!name) return {};
  const std::optional<gid_t> id = id_of(*name);
  if (!id) {
    throw Error(ErrorKind::usage, url.text(), "there is no group '" + *name + "' on this machine",
                "share it with one that is there (getent group), or make it: groupadd NAME");
  }
  if (!is_ours(*id)) {
    throw Error(ErrorKind::permission, url.text(), "this user is not in the group " + *name,
                "have it added (usermod -aG " + *name + " USER), and log in again");
  }
  return {*name, *id};
}

}  // namespace r4
