// SPDX-License-Identifier: GPL-3.0-or-later
#include "names.hpp"

#include <algorithm>

#include "r4link/error.hpp"

namespace r4::tool::ros2 {
namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_part_character(char c) {
  return is_digit(c) || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
}
bool is_part(std::string_view part) {
  return !part.empty() && !is_digit(part.front()) && part.find("__") == std::string_view::npos &&
         std::all_of(part.begin(), part.end(), is_part_character);
}

void require(bool valid, std::string_view what, std::string_view text) {
  if (valid) return;
  throw Error(
      ErrorKind::usage, std::string(what) + " " + std::string(text), "is not a valid name in ROS 2",
      "use letters, digits and single underscores, beginning with a letter, such as arm_left");
}

}  // namespace

NodeName node_name(std::string_view space, std::string_view name) {
  require(is_part(name), "--name", name);
  std::string_view rest = space;
  if (rest.starts_with('/')) rest.remove_prefix(1);
  NodeName node;
  node.name = name;
  if (rest.empty()) return node;
  node.space = "/" + std::string(rest);
  for (bool more = true; more;) {
    const std::size_t slash = rest.find('/');
    more = slash != std::string_view::npos;
    require(is_part(rest.substr(0, slash)), "--namespace", space);
    if (more) rest.remove_prefix(slash + 1);
  }
  return node;
}

std::string below(std::string_view space, std::string_view part) {
  std::string full(space);
  if (!full.ends_with('/')) full += '/';
  return full.append(part);
}

std::string full_name(const NodeName& node, std::string_view topic) {
  if (topic.starts_with('/')) return std::string(topic);
  if (topic.starts_with("~/")) return below(node.full(), topic.substr(2));
  return below(node.space, topic);
}

std::string dds_topic(std::string_view full_name) { return "rt" + std::string(full_name); }
std::string dds_request(std::string_view full_name) {
  return "rq" + std::string(full_name) + "Request";
}
std::string dds_reply(std::string_view full_name) {
  return "rr" + std::string(full_name) + "Reply";
}

}  // namespace r4::tool::ros2
