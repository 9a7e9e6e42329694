in vec3 v_direction;
in vec2 v_place;

uniform sampler2D image;

out vec4 seen;

void main() {
    seen = vec4(texture(image, v_place).rgb, 1.0);
}
