"""Motion Token Playground: motions become tokens, tokens become motions, text guides both ways."""
