// SPDX-License-Identifier: GPL-3.0-or-later
// What is known to break a promise: in which story, by how many faults, and what (search.hpp). The
// search has to find each of these lines. One that it does not find has to be deleted.
//
//     stranger-joins     a watcher guesses a heartbeat of the host, and its address becomes a path
//                        of the session. Over a bridge it resumes the session of a killed host
//     stranger-inherits  a program that gets the address of a killed host continues its session
//     stranger-copies    a signed heartbeat that is sent again at once makes that address a path
#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

namespace r4::simulation {

struct Known {
  std::string_view story;
  std::size_t faults;
  std::string_view what;
};

inline const std::vector<Known> found_today = {
    {"begin", 1, "joined: stranger-joins"},
    {"begin", 2, "joined: stranger-beats"},
    {"begin", 2, "joined: stranger-inherits"},
    {"begin", 2, "stranger: stranger-inherits"},
    {"bridge", 1, "joined: stranger-inherits"},
    {"bridge", 1, "restore: stranger-joins"},
    {"bridge", 1, "resumed: stranger-beats"},
    {"bridge", 1, "resumed: stranger-inherits"},
    {"bridge", 1, "resumed: stranger-joins"},
    {"bridge for two", 1, "joined: stranger-inherits"},
    {"bridge for two", 1, "resumed: stranger-beats"},
    {"bridge for two", 1, "resumed: stranger-inherits"},
    {"bridge for two", 1, "resumed: stranger-joins"},
    {"bridge for two", 1, "stranger: stranger-inherits"},
    {"bridge watched", 1, "joined: stranger-inherits"},
    {"bridge watched", 1, "restore: stranger-joins"},
    {"bridge watched", 1, "resumed: stranger-beats"},
    {"bridge watched", 1, "resumed: stranger-inherits"},
    {"bridge watched", 1, "resumed: stranger-joins"},
    {"cable", 1, "joined: stranger-beats"},
    {"cable", 1, "joined: stranger-elsewhere"},
    {"cable", 1, "joined: stranger-inherits"},
    {"cable", 1, "joined: stranger-joins"},
    {"cable", 1, "resumed: stranger-inherits"},
    {"drive", 1, "joined: stranger-beats"},
    {"drive", 1, "joined: stranger-joins"},
    {"drive", 2, "joined: stranger-inherits"},
    {"drive", 2, "pushed: stranger-inherits"},
    {"drive", 2, "stranger: stranger-inherits"},
    {"end", 2, "joined: stranger-beats stranger-inherits"},
    {"end", 2, "joined: stranger-beats"},
    {"end", 2, "joined: stranger-inherits"},
    {"end", 2, "joined: stranger-joins stranger-inherits"},
    {"end", 2, "joined: stranger-joins"},
    {"end", 2, "resumed: stranger-inherits"},
    {"end", 2, "stranger: stranger-inherits"},
    {"farewell", 1, "joined: stranger-beats"},
    {"farewell", 1, "joined: stranger-inherits"},
    {"farewell", 1, "joined: stranger-joins"},
    {"key", 1, "joined: stranger-copies"},
    {"key and two paths", 1, "joined: stranger-copies"},
    {"killed", 1, "joined: stranger-beats"},
    {"killed", 1, "joined: stranger-inherits"},
    {"killed", 1, "joined: stranger-joins"},
    {"killed", 1, "resumed: stranger-inherits"},
    {"one address", 1, "joined: stranger-joins"},
    {"one address", 2, "joined: stranger-beats"},
    {"one address", 2, "joined: stranger-inherits"},
    {"one address", 2, "stranger: stranger-inherits"},
    {"reboot", 1, "joined: stranger-beats"},
    {"reboot", 1, "joined: stranger-joins"},
    {"reboot", 2, "joined: stranger-inherits"},
    {"reboot", 2, "stranger: stranger-inherits"},
    {"restart", 1, "joined: stranger-beats"},
    {"restart", 1, "joined: stranger-inherits"},
    {"restart", 1, "joined: stranger-joins"},
    {"sleep", 1, "joined: stranger-beats"},
    {"sleep", 1, "joined: stranger-joins"},
    {"sleep", 2, "joined: stranger-inherits"},
    {"sleep", 2, "restore: stranger-inherits"},
    {"sleep", 2, "resumed: stranger-inherits"},
    {"sleep", 2, "stranger: stranger-inherits"},
    {"two paths", 1, "joined: stranger-beats"},
    {"two paths", 1, "joined: stranger-elsewhere"},
    {"two paths", 1, "joined: stranger-joins"},
    {"two paths", 2, "joined: stranger-inherits"},
    {"two paths", 2, "stranger: stranger-inherits"},
    {"two paths at one port", 1, "joined: stranger-beats"},
    {"two paths at one port", 1, "joined: stranger-elsewhere"},
    {"two paths at one port", 1, "joined: stranger-inherits"},
    {"two paths at one port", 1, "joined: stranger-joins"},
    {"two paths at one port", 1, "resumed: stranger-inherits"},
    {"waiting", 1, "joined: stranger-beats"},
    {"waiting", 1, "joined: stranger-inherits"},
    {"waiting", 1, "joined: stranger-joins"},
    {"waiting", 1, "resumed: stranger-inherits"},
    {"waiting", 1, "stranger: stranger-inherits"},
    {"watched", 1, "joined: stranger-beats"},
    {"watched", 1, "joined: stranger-inherits"},
    {"watched", 1, "joined: stranger-joins"},
    {"watched", 1, "restore: stranger-inherits"},
    {"watched", 1, "resumed: stranger-inherits"},
};

}  // namespace r4::simulation
