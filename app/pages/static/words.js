// Parsing of input fields with several values, with the rules of the command line.

/** Parts of a text, separated by spaces, semicolons, or commas followed by a space. */
export function list(text) {
  return text.split(/[\s;]+|,\s+/).filter((part) => part !== "");
}

/** Known values; spaces around the signs are allowed, as in "Kt25 = 0.048 ± 5 %, L = 2.9e-3". */
export function knownWords(text) {
  return list(text.trim().replace(/\s*(=|\+-|±)\s*/g, "$1").replace(/\s+%/g, "%"));
}
