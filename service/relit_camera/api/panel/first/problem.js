// What went wrong and its cure, shown beside the thing that it is about.

import { sentence } from "../api.js";
import { make } from "../widgets.js";

/** Makes a place for a problem, empty and hidden; screen readers tell its words when they appear. */
export function problemPlace(id) {
  return make("div", { id, className: "problem", role: "alert", hidden: true });
}

/** Shows what is wrong and its cure, or nothing where `problem` is null. */
export function showProblem(place, problem) {
  place.hidden = !problem;
  if (!problem) return place.replaceChildren();
  const what = make("strong", {}, sentence(problem.what ?? problem.message));
  place.replaceChildren(what, ...(problem.cure ? [make("span", {}, sentence(problem.cure))] : []));
}
