in vec4 v_color;
out vec4 seen;

void main() {
    seen = v_color;
}
